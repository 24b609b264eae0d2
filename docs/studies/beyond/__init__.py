"""A step beyond the papers: friction in the observer, the bias fed in, and all observers in one table."""
