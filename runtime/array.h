/* array.h - a growing array of elements of one size.
 *
 *     pl_array items = {.element = sizeof(pl_item)};
 *     pl_item *item = pl_array_extend(&items, 1);     NULL: no memory
 *
 * Extending moves the elements, so pointers to them don't survive it; `data` is the caller's to free. */
#ifndef PL_ARRAY_H
#define PL_ARRAY_H

#include <stddef.h>
#include <stdlib.h>

typedef struct pl_array {
    void *data;
    size_t count, capacity, element;
} pl_array;

/* Room for `more` elements at the end; NULL: no memory. */
static inline void *pl_array_extend(pl_array *a, size_t more)
{
    if (a->count + more > a->capacity || !a->data) {
        size_t capacity = 2 * (a->count + more) + 8;
        void *data = realloc(a->data, capacity * a->element);
        if (!data) return NULL;
        a->data = data;
        a->capacity = capacity;
    }
    void *place = (char *)a->data + a->count * a->element;
    a->count += more;
    return place;
}

#endif
