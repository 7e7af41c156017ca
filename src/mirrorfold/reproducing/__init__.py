"""The published experiments, computed anew, and questions that they leave open: claims, numbers, verdicts."""

from mirrorfold.reproducing.catalogue import EXPERIMENTS, Experiment
from mirrorfold.reproducing.findings import Claim, Findings, Table
from mirrorfold.reproducing.run import Reproduction, reproduce
from mirrorfold.reproducing.work import Work

__all__ = ["EXPERIMENTS", "Claim", "Experiment", "Findings", "Reproduction", "Table", "Work", "reproduce"]
