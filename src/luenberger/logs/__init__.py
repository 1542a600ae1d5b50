"""Readers of recorded logs: channel maps, units at the door, clocks and gaps."""

from luenberger.logs.channel_map import Channel, ChannelMap, channel_map, read_channel_map
from luenberger.logs.clock import ClockReport, Gap, inspect_clock
from luenberger.logs.table import read_log

__all__ = [
    "Channel",
    "ChannelMap",
    "ClockReport",
    "Gap",
    "channel_map",
    "inspect_clock",
    "read_channel_map",
    "read_log",
]
