/* loop.c of the master, with the names that nest.h gives to what it has in common with the core of an FMU. */
#define do_step part_do_step
#define fail loop_fail

#include "loop.inc"
