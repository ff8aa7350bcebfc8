"""The loop that asks the machine: record, diagnose, and where the answer is open, move so that it is decided.

motions.py       families of motion that a mechanic understands, inside limits
limits.py        what a motion may not leave, before it is run and in what was recorded
questions.py     what a diagnosis leaves open, as structures that can be compared
design.py        the motion that tells most: expected log-odds between the structures, after a refit
machine.py       what is moved: the co-simulated plant of a scenario
loop.py          the rounds, until one answer is left or the budget is spent
log.py, story.py what was done, line by line, so that a kill loses nothing; and in words
"""
