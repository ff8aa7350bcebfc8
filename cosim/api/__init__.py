"""What Python code and notebooks call: `import cosim` offers these functions and what they return.

One module a function. The verbs of the command line do the same with files.
"""
