/* test_improve.c - an improved binary tree has the same leaves, and each box is that of what is below. Boxes on a coarse
 * grid often contain each other, as shapes do that are scaled about one point. */
#include <stdint.h>
#include <string.h>

#include "accel/front_binary.h"
#include "check.h"

enum { LEAVES = 40, NODES = 2 * LEAVES - 1, ROUNDS = 2000, GRID = 8 };

static uint64_t state = 12345;

/* 0 … count - 1 (xorshift). */
static int any(int count)
{
    state ^= state << 13;
    state ^= state >> 7;
    state ^= state << 17;
    return (int)(state >> 33) % count;
}

/* The tree of `leaves` random boxes from node *next on; returns its root. */
static uint32_t make(pl_binary *tree, uint32_t *next, uint32_t parent, int leaves)
{
    const uint32_t index = (*next)++;
    pl_binary *node = &tree[index];
    *node = (pl_binary){.parent = parent, .ref = PL_NOTHING, .box = NOTHING};
    if (leaves == 1) {
        node->ref = index;
        for (int axis = 0; axis < 3; axis++) {
            const int a = any(GRID), b = any(GRID);
            node->box.lo[axis] = (float)(a < b ? a : b);
            node->box.hi[axis] = (float)(a < b ? b : a);
        }
    } else {
        const int left = 1 + any(leaves - 1);
        node->left = make(tree, next, index, left);
        node->right = make(tree, next, index, leaves - left);
        join(&node->box, tree[node->left].box);
        join(&node->box, tree[node->right].box);
    }
    node->area = area(&node->box);
    return index;
}

/* Checks a node and what is below; returns its leaves. */
static int check(const pl_binary *tree, uint32_t index)
{
    const pl_binary *node = &tree[index];
    if (node->ref != PL_NOTHING) {
        CHECK(node->ref == index);
        return 1;
    }
    bounds both = tree[node->left].box;
    join(&both, tree[node->right].box);
    CHECK(memcmp(&both, &node->box, sizeof both) == 0);
    CHECK(node->area == area(&both));
    CHECK(tree[node->left].parent == index && tree[node->right].parent == index);
    return check(tree, node->left) + check(tree, node->right);
}

int main(void)
{
    static pl_binary tree[NODES];
    for (int round = 0; round < ROUNDS; round++) {
        uint32_t next = 0;
        make(tree, &next, 0, LEAVES);
        pl_binary_improve(tree, NODES);
        CHECK(check(tree, 0) == LEAVES);
    }
    return check_result();
}
