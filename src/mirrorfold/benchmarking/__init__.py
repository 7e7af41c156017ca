"""Benchmarks: methods are judged on families of random scenes whose truth is known."""

from mirrorfold.benchmarking.comparing import BenchmarkComparison, compare_benchmarks
from mirrorfold.benchmarking.run import benchmark
from mirrorfold.benchmarking.summaries import Benchmark

__all__ = ["Benchmark", "BenchmarkComparison", "benchmark", "compare_benchmarks"]
