/* error.h - how the runtime says what went wrong: one place, one reason.
 *
 *     if (count > PL_LIMIT_NODES)
 *         return pl_fail(error, PL_ERROR_LIMIT, "nodes", "%u nodes, at most %u", count, PL_LIMIT_NODES);
 *
 * The first error is the one that counts: a later pl_fail on an error that is already set leaves it as it is, so that
 * clean-up code can't hide the cause. A function that can fail starts with nobody having called pl_error_clear but
 * the public entry points. */
#ifndef PL_ERROR_H
#define PL_ERROR_H

#include "plsys.h"

/* Sets *error (which may be NULL) to code, place and a printf-style reason. Always returns false. */
bool pl_fail(pl_error *error, int code, const char *place, const char *format, ...)
    __attribute__((format(printf, 4, 5)));

/* "out of memory" while doing `what`; always returns false. */
bool pl_fail_memory(pl_error *error, const char *what);

/* A scene's states and structures need more bytes than are allowed; always returns false. */
bool pl_fail_allowed(pl_error *error, double needed, double allowed);

void pl_error_clear(pl_error *error);

/* Room for pl_number_text: "-1.2345678901234567e-308" and a NUL. */
enum { PL_NUMBER_TEXT = 32 };

/* The shortest text of 15, 16 or 17 significant digits (%.15g …) that reads back as the same double; "-0" as "0".
 * Returns buffer. Python's equivalent is in compiler/bytecode/disassemble.py. */
char *pl_number_text(double value, char buffer[PL_NUMBER_TEXT]);

#endif
