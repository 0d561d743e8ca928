/* error.c - see error.h. */
#include "error.h"

#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "program.h"

static bool fail(pl_error *error, int code, const char *place, const char *format, va_list arguments)
{
    if (error && error->code == PL_OK) {
        error->code = code;
        snprintf(error->place, sizeof error->place, "%s", place);
        vsnprintf(error->reason, sizeof error->reason, format, arguments);
    }
    return false;
}

bool pl_fail(pl_error *error, int code, const char *place, const char *format, ...)
{
    va_list arguments;
    va_start(arguments, format);
    fail(error, code, place, format, arguments);
    va_end(arguments);
    return false;
}

bool pl_fail_at(pl_error *error, int code, const pl_program *program, uint32_t node, const char *format, ...)
{
    char place[256];
    va_list arguments;
    va_start(arguments, format);
    fail(error, code, pl_program_place(program, node, place, sizeof place), format, arguments);
    va_end(arguments);
    return false;
}

bool pl_fail_memory(pl_error *error, const char *what)
{
    return pl_fail(error, PL_ERROR_MEMORY, what, "out of memory");
}

bool pl_fail_allowed(pl_error *error, double needed, double allowed)
{
    const bool few = allowed < 1024.0; /* as where a unit was forgotten */
    return pl_fail(error, PL_ERROR_LIMIT, "memory", "this scene needs at least %.0f KB; %.0f %s are allowed",
                   ceil(needed / 1024.0), few ? allowed : allowed / 1024.0, few ? "bytes" : "KB");
}

void pl_error_clear(pl_error *error)
{
    if (error) {
        error->code = PL_OK;
        error->place[0] = error->reason[0] = '\0';
    }
}

char *pl_number_text(double value, char buffer[PL_NUMBER_TEXT])
{
    for (int digits = 15; digits <= 17; digits++) {
        snprintf(buffer, PL_NUMBER_TEXT, "%.*g", digits, value == 0 ? 0.0 : value);
        if (strtod(buffer, NULL) == value)
            break;
    }
    return buffer;
}
