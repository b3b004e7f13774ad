"""The doctor: looks at everything that a race needs, one check after the other, and says of each fault what to do.

Each check has two halves: a gatherer that finds facts on the real machine, and a rule that makes a verdict of them and of
nothing else. It works beside a running service, whose camera it never takes. Knows no command line.
"""
