/* front_collapse.c - the wide tree of the least total area that a binary tree can be collapsed into, by dynamic programming
 * (Ylitie, Karras & Laine, "Efficient incoherent ray traversal on GPUs through compressed wide BVHs", 2017, section 3.2):
 *
 *     cost(t, 1)     = price + area(t) + best(t, 8)                 t as one node            (0: a single box)
 *     best(t, slots) = min over k of cost(left, k) + cost(right, slots - k)
 *     cost(t, slots) = min(best(t, slots), cost(t, slots - 1))      t as at most so many children */
#include "front_binary.h"

typedef struct costs {
    float as[PL_FRONT_WIDTH]; /* at most 1 … 7 children */
} costs;

typedef struct emitting {
    const pl_binary *tree;
    pl_front_node *nodes;
    uint32_t *count;
} emitting;

/* Costs of a binary node, and how each comes from those of its children. */
static costs find_costs(pl_binary *tree, uint32_t index, float price)
{
    pl_binary *t = &tree[index];
    costs own = {{0}};
    if (t->ref != PL_NOTHING) return own;
    const costs left = find_costs(tree, t->left, price), right = find_costs(tree, t->right, price);
    for (int slots = 2; slots <= PL_FRONT_WIDTH; slots++) {
        float best = INFINITY;
        int best_left = 1;
        for (int k = 1; k < slots; k++) {
            const float cost = left.as[k] + right.as[slots - k];
            if (cost < best) {
                best = cost;
                best_left = k;
            }
        }
        if (slots < PL_FRONT_WIDTH) own.as[slots] = best;
        else own.as[1] = price + t->area + best;
        t->left_slots[slots] = (uint8_t)best_left;
    }
    for (int slots = 2; slots < PL_FRONT_WIDTH; slots++)
        if (own.as[slots - 1] <= own.as[slots]) {
            own.as[slots] = own.as[slots - 1];
            t->left_slots[slots] = 0;
        }
    return own;
}

static pl_ref emit(const emitting *e, uint32_t index);

/* A binary node as at most so many children of a wide one, which has `number` so far. */
static int emit_children(const emitting *e, uint32_t index, int slots, pl_front_node *node, int number)
{
    const pl_binary *t = &e->tree[index];
    while (slots > 1 && t->ref == PL_NOTHING && t->left_slots[slots] == 0) slots--;
    if (slots == 1 || t->ref != PL_NOTHING) {
        for (int axis = 0; axis < 3; axis++) {
            node->planes[axis][number] = t->box.lo[axis];
            node->planes[3 + axis][number] = t->box.hi[axis];
        }
        node->child[number] = t->ref != PL_NOTHING ? t->ref : emit(e, index);
        return number + 1;
    }
    number = emit_children(e, t->left, t->left_slots[slots], node, number);
    return emit_children(e, t->right, slots - t->left_slots[slots], node, number);
}

static pl_ref emit(const emitting *e, uint32_t index)
{
    const uint32_t place = (*e->count)++;
    pl_front_node *node = &e->nodes[place];
    const pl_binary *t = &e->tree[index];
    clear_node(node);
    int number = emit_children(e, t->left, t->left_slots[PL_FRONT_WIDTH], node, 0);
    emit_children(e, t->right, PL_FRONT_WIDTH - t->left_slots[PL_FRONT_WIDTH], node, number);
    return pl_ref_of(PL_KIND_NODE, place);
}

pl_ref pl_binary_collapse(pl_binary *tree, float price, pl_front_node *nodes, uint32_t *count)
{
    const emitting e = {tree, nodes, count};
    find_costs(tree, 0, price);
    return emit(&e, 0);
}
