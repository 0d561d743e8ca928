/* front_links.c - the transformations down to a front's opened nodes, one list each (front.h).
 *
 *     pl_front_link(&front, states, room)    opened nodes and their items → front.maps, front.links: 2.1 KB in Menger 4
 *
 * A candidate's ray is mapped down the path in double. Finding the transformations from node to node is a chain of loads, each
 * of which waits for the one before; lists are read ahead. A front has few different maps, so an entry is one byte. A node whose
 * item has no transformations shares its parent's list, and a first child continues it: half the bytes of lists by themselves. */
#include "front.h"

#include <stdlib.h>
#include <string.h>

/* Lists are made where they take no more than this share of a front's nodes. */
#define LINKS_SHARE 0.15

enum { MOST_MAPS = UINT8_MAX, MOST_LINKS = 1 << 24 };

typedef struct linker {
    const pl_transform *maps[1 + MOST_MAPS]; /* from 1 on */
    uint32_t map_count;
    uint8_t *links;
    pl_front_list *lists; /* of opened nodes */
    size_t used, most;
} linker;

/* The number of a transformation among the maps, where it is added; 0: there are too many. */
static uint8_t number_of(linker *l, const pl_transform *transform)
{
    uint32_t map = 1;
    while (map <= l->map_count && l->maps[map] != transform) map++;
    if (map > MOST_MAPS) return 0;
    if (map > l->map_count) l->maps[++l->map_count] = transform;
    return (uint8_t)map;
}

/* The list of an opened node: that of its parent, which comes before, then its item's transformations. Where the parent's
 * is the last one, its own goes on from there. false: no room. */
static bool add_list(linker *l, const pl_states *states, const pl_opened *opened, uint32_t node)
{
    const pl_item *item = pl_front_item(states, opened[node].item);
    const pl_front_list above = l->lists[opened[node].parent];
    const size_t more = item->transform_count, length = above.length + more;
    pl_front_list *list = &l->lists[node];
    *list = above;
    if (!more) return true;
    const bool goes_on = above.first + above.length == l->used;
    if (length > UINT8_MAX || more + (goes_on ? 0 : above.length) > l->most - l->used) return false;
    if (!goes_on) {
        list->first = (uint32_t)l->used & 0xFFFFFF;
        memcpy(l->links + l->used, l->links + above.first, above.length);
        l->used += above.length;
    }
    list->length = (uint32_t)length & UINT8_MAX;
    for (size_t i = 0; i < more; i++)
        if (!(l->links[l->used++] = number_of(l, item->transforms[i]))) return false;
    return true;
}

static size_t maps_bytes(const linker *l)
{
    return (1 + l->map_count) * sizeof *l->maps;
}

static bool add_all(linker *l, const pl_states *states, const pl_front *front)
{
    l->lists[0] = (pl_front_list){0};
    for (uint32_t node = 1; node < front->opened_count; node++)
        if (!add_list(l, states, front->opened, node)) return false;
    return l->used + maps_bytes(l) <= l->most;
}

/* Makes the lists the front's. 0: no memory. */
static size_t keep(const linker *l, pl_front *front)
{
    const size_t bytes = maps_bytes(l);
    pl_opened *opened = (pl_opened *)front->opened;
    unsigned char *memory = malloc(bytes + l->used);
    if (!memory) return 0;
    memcpy(memory, l->maps, bytes);
    memcpy(memory + bytes, l->links, l->used);
    front->maps = (const pl_transform *const *)memory;
    front->links = memory + bytes;
    for (uint32_t node = 0; node < front->opened_count; node++) opened[node].list = l->lists[node];
    return bytes + l->used;
}

size_t pl_front_link(pl_front *front, const pl_states *states, size_t room)
{
    const size_t share = (size_t)(LINKS_SHARE * (double)(front->node_count * sizeof *front->nodes));
    linker l = {.most = share < room ? share : room};
    if (l.most > MOST_LINKS) l.most = MOST_LINKS;
    size_t bytes = 0;
    if (!l.most || front->opened_count < 2) return 0;
    l.links = malloc(l.most);
    l.lists = malloc(front->opened_count * sizeof *l.lists);
    if (l.links && l.lists && add_all(&l, states, front)) bytes = keep(&l, front);
    free(l.links);
    free(l.lists);
    return bytes;
}
