/* query.h - the hits of a query that wants them all. */
#ifndef PL_QUERY_H
#define PL_QUERY_H

#include "accel.h"

typedef struct pl_hit_list {
    pl_hit *hits; /* all `capacity` of them initialised, so that their paths' memory is used again */
    size_t count, capacity;
} pl_hit_list;

/* Into (t, path) order. */
void pl_hit_list_sort(pl_hit_list *list);
void pl_hit_list_free(pl_hit_list *list);

#endif
