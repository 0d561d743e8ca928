/* front_improve.c - a binary tree improved by taking subtrees out and putting them where areas grow least (Bittner, Hapala &
 * Havran, "Fast insertion-based optimization of bounding volume hierarchies", 2013). The search goes up from where a subtree
 * was (Meister & Bittner, "Parallel reinsertion for bounding volume hierarchy optimization", 2018).
 *
 * Taking node n out of its parent p saves area(p), and what the nodes above p lose. Beside a node q it costs the area of both
 * together, and what the nodes above q gain. Nothing changes from the lowest node on that has both p and q below. So the
 * search goes up from p, and from each node on the way down into the other child, as long as more is saved than n's own area,
 * the least that a place can cost.
 *
 *         a                    a          saves area(p): a has n below as before
 *       /   \                /   \        costs area(n and q together)
 *      p     q     ->       s     p
 *     / \                        / \
 *    n   s                      n   q */
#include "front_binary.h"

/* Of one search, which takes 13 to 37 on the average: bounds the time where all boxes overlap. */
enum { MOST_STEPS = 64 };

/* What is saved by putting a subtree beside a node; where that is still to be looked at, before their common area is paid. */
typedef struct place {
    uint32_t at;
    float gain;
} place;

static inline uint32_t sibling_of(const pl_binary *tree, uint32_t node)
{
    const pl_binary *parent = &tree[tree[node].parent];
    return parent->left == node ? parent->right : parent->left;
}

/* Searches at a node and below it; returns the steps taken. */
static int search(const pl_binary *tree, const pl_binary *node, place from, int steps, place *best)
{
    place stack[MOST_STEPS + 2];
    int top = 0;
    stack[top++] = from;
    while (top && steps < MOST_STEPS) {
        const place next = stack[--top];
        if (next.gain - node->area <= best->gain) continue;
        const pl_binary *at = &tree[next.at];
        bounds both = at->box;
        join(&both, node->box);
        const float gain = next.gain - area(&both), below = gain + at->area;
        steps++;
        if (gain > best->gain) *best = (place){next.at, gain};
        if (at->ref != PL_NOTHING || below - node->area <= best->gain) continue;
        stack[top++] = (place){at->left, below};
        stack[top++] = (place){at->right, below};
    }
    return steps;
}

/* Where a node saves most; gain 0: where it is. */
static place find_place(const pl_binary *tree, uint32_t index)
{
    const pl_binary *node = &tree[index];
    place best = {0, 0.0f};
    bounds rest = NOTHING; /* what is below the pivot without the node */
    float gain = tree[node->parent].area;
    int steps = 0;
    for (uint32_t pivot = index; pivot != 0 && steps < MOST_STEPS; pivot = tree[pivot].parent) {
        const uint32_t other = sibling_of(tree, pivot);
        if (pivot != index) {
            if (pivot != node->parent) gain += tree[pivot].area - area(&rest);
            steps = search(tree, node, (place){other, gain}, steps, &best);
        }
        join(&rest, tree[other].box);
    }
    return best;
}

static void fit(pl_binary *node, const pl_binary *tree)
{
    node->box = tree[node->left].box;
    join(&node->box, tree[node->right].box);
    node->area = area(&node->box);
}

/* Boxes from a node up, as far as they change. */
static void refit(pl_binary *tree, uint32_t at)
{
    for (;; at = tree[at].parent) {
        const bounds before = tree[at].box;
        fit(&tree[at], tree);
        if (at == 0 || memcmp(&before, &tree[at].box, sizeof before) == 0) return;
    }
}

static void replace_child(pl_binary *tree, uint32_t old, uint32_t fresh)
{
    const uint32_t parent = tree[old].parent;
    if (tree[parent].left == old) tree[parent].left = fresh;
    else tree[parent].right = fresh;
    tree[fresh].parent = parent;
}

/* Moves a node, with its parent, beside another. */
static void move(pl_binary *tree, uint32_t node, uint32_t to)
{
    const uint32_t parent = tree[node].parent, above = tree[parent].parent;
    replace_child(tree, parent, sibling_of(tree, node));
    replace_child(tree, to, parent);
    tree[parent].left = node;
    tree[parent].right = to;
    tree[to].parent = parent;
    /* Its box may be what it was where it stood before (the node's, if that contains both), and still be news above it. */
    fit(&tree[parent], tree);
    refit(tree, tree[parent].parent);
    refit(tree, above);
}

/* Once for each node, those below before those above: a second time would gain another 1 % of the visits, and a picture
 * doesn't earn back what that takes. */
void pl_binary_improve(pl_binary *tree, uint32_t count)
{
    for (uint32_t i = count; i-- > 1;) {
        if (tree[i].parent == 0) continue;
        const place to = find_place(tree, i);
        if (to.gain > 0.0f) move(tree, i, to.at);
    }
}
