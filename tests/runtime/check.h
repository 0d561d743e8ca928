/* check.h - CHECK(condition) for C tests: says where it fails, goes on, and makes the exit code 1. */
#ifndef CHECK_H
#define CHECK_H

#include <stdio.h>

static int check_failures;

#define CHECK(condition) \
    ((condition) ? (void)0 \
                 : (void)(check_failures++, printf("%s:%d: not true: %s\n", __FILE__, __LINE__, #condition)))

static inline int check_result(void)
{
    return check_failures != 0;
}

#endif
