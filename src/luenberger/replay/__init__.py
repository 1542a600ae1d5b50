"""Observers run over trajectories in one scan, and the scores that rank them."""

from luenberger.replay.batch import ReplayBatch, replay_batch
from luenberger.replay.channels import Channels
from luenberger.replay.replay import Replay, replay
from luenberger.replay.scores import Score, score_table, scores

__all__ = ["Channels", "Replay", "ReplayBatch", "Score", "replay", "replay_batch", "score_table", "scores"]
