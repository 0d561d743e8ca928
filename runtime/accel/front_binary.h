/* front_binary.h - a binary tree over a front's boxes: what stands between dividing them and the wide tree.
 *
 *     front_tree.c      boxes -> binary tree      front_improve.c   binary tree -> a better one
 *     front_collapse.c  binary tree -> nodes of eight */
#ifndef PL_FRONT_BINARY_H
#define PL_FRONT_BINARY_H

#include "front_bounds.h"

/* One line of the cache. Node 0 is the root. */
typedef struct pl_binary {
    _Alignas(64) bounds box;
    float area;
    uint32_t parent, left, right;
    pl_ref ref; /* of a single box; else PL_NOTHING */
    uint8_t left_slots[PL_FRONT_WIDTH + 1]; /* of so many slots; 0: with fewer slots it is no worse (front_collapse.c) */
} pl_binary;

/* Moves subtrees to where the sum of all nodes' areas becomes less. */
void pl_binary_improve(pl_binary *tree, uint32_t count);

/* Appends the best wide tree's nodes to nodes[*count …]; price: of a node's memory, as an area. */
pl_ref pl_binary_collapse(pl_binary *tree, float price, pl_front_node *nodes, uint32_t *count);

static inline void clear_node(pl_front_node *node)
{
    for (int i = 0; i < PL_FRONT_WIDTH; i++) {
        for (int axis = 0; axis < 3; axis++) {
            node->planes[axis][i] = INFINITY;
            node->planes[3 + axis][i] = -INFINITY;
        }
        node->child[i] = PL_NOTHING;
    }
}

#endif
