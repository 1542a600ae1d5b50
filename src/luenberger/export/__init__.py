"""What leaves for the target: C99 with golden vectors, gain tables, and what is proved of the step that ships."""

from luenberger.export.build import Build, build, write_c
from luenberger.export.c import CCode, c_code
from luenberger.export.c_table import table_header
from luenberger.export.golden import Golden, golden
from luenberger.export.guard import Guarded
from luenberger.export.sampled import SampledStep, sampled_step
from luenberger.export.signals import Signals
from luenberger.export.tables import Axis, GainTable, look_up_table
from luenberger.export.to_c import Exported, export_c

__all__ = [
    "Axis",
    "Build",
    "CCode",
    "Exported",
    "GainTable",
    "Golden",
    "Guarded",
    "SampledStep",
    "Signals",
    "build",
    "c_code",
    "export_c",
    "golden",
    "look_up_table",
    "sampled_step",
    "table_header",
    "write_c",
]
