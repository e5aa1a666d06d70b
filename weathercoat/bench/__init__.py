"""The benchmark: a fixed situation, run at many sizes, each in a process of its own, and what came of it."""
