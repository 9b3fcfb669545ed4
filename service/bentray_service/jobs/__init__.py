"""Jobs: their kinds, the runner, progress, and problems of failed jobs."""
