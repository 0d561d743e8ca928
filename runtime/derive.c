/* derive.c - the walk over the derivation (derive.h). */
#include "derive.h"

#include <stdlib.h>
#include <string.h>

#include "error.h"
#include "reach.h"

/* --- paths and packed scopes --- */

bool pl_path_push(pl_path *path, uint32_t length, uint32_t term)
{
    if (length >= path->capacity) {
        uint32_t capacity = path->capacity ? 2 * path->capacity : 32;
        uint32_t *terms = realloc(path->terms, capacity * sizeof *terms);
        if (!terms) return false;
        path->terms = terms;
        path->capacity = capacity;
    }
    path->terms[length] = term;
    return true;
}

bool pl_path_copy(pl_path *path, const pl_path *from, uint32_t length)
{
    if (length > path->capacity) {
        uint32_t *terms = realloc(path->terms, length * sizeof *terms);
        if (!terms) return false;
        path->terms = terms;
        path->capacity = length;
    }
    if (length) memcpy(path->terms, from->terms, length * sizeof *path->terms);
    path->length = length;
    return true;
}

int pl_path_compare(const pl_path *a, const pl_path *b)
{
    uint32_t shorter = a->length < b->length ? a->length : b->length;
    for (uint32_t i = 0; i < shorter; i++)
        if (a->terms[i] != b->terms[i]) return a->terms[i] < b->terms[i] ? -1 : 1;
    return (a->length > b->length) - (a->length < b->length);
}

/* Layout: key · symbol · number of draws · streams drawn from · parameters. */
size_t pl_scope_words(const pl_program *program, const pl_scope *scope)
{
    return 3 + scope->draws + program->parameter_count;
}

void pl_scope_pack(const pl_program *program, const pl_scope *scope, uint64_t *words)
{
    words[0] = scope->key;
    words[1] = scope->symbol;
    words[2] = scope->draws;
    memcpy(words + 3, scope->drawn, scope->draws * sizeof *words);
    if (program->parameter_count)
        memcpy(words + 3 + scope->draws, scope->parameters, program->parameter_count * sizeof *words);
}

void pl_scope_unpack(const pl_program *program, const uint64_t *words, pl_scope *scope)
{
    scope->key = words[0];
    scope->symbol = (uint32_t)words[1];
    scope->draws = (uint32_t)words[2];
    memcpy(scope->drawn, words + 3, scope->draws * sizeof *words);
    if (program->parameter_count)
        memcpy(scope->parameters, words + 3 + scope->draws, program->parameter_count * sizeof *words);
}

/* --- beginning and ending --- */

void pl_walk_restart(pl_walk *walk, uint32_t node, const pl_scope *scope)
{
    if (scope) {
        pl_scope_copy(walk->program, scope, &walk->scope);
    } else {
        walk->scope.key = 0;
        walk->scope.symbol = UINT32_MAX;
        walk->scope.draws = 0;
        for (uint32_t slot = 0; slot < walk->program->parameter_count; slot++) walk->scope.parameters[slot] = NAN;
    }
    walk->at = (pl_spot){.symbol = UINT32_MAX, .rule = -1};
    walk->path.length = 0;
    walk->pending_count = walk->scopes_used = 0;
    walk->singular = 0;
    walk->announced = false;
    walk->next = node;
}

bool pl_walk_begin(pl_walk *walk, const pl_program *program, uint32_t node, const pl_scope *scope, pl_error *error)
{
    memset(walk, 0, sizeof *walk);
    walk->program = program;
    walk->scope.parameters = malloc((program->parameter_count + 1) * sizeof(double));
    if (!walk->scope.parameters) return pl_fail_memory(error, "walking the derivation");
    pl_walk_restart(walk, node, scope);
    return true;
}

void pl_walk_end(pl_walk *walk)
{
    free(walk->scope.parameters);
    free(walk->path.terms);
    free(walk->pending);
    free(walk->scopes);
    memset(walk, 0, sizeof *walk);
}

/* --- unions --- */

/* Makes room for one more pending union and its packed scope. */
static bool reserve(pl_walk *walk, size_t words)
{
    if (walk->pending_count == walk->pending_capacity) {
        size_t capacity = walk->pending_capacity ? 2 * walk->pending_capacity : 16;
        pl_pending *pending = realloc(walk->pending, capacity * sizeof *pending);
        if (!pending) return false;
        walk->pending = pending;
        walk->pending_capacity = capacity;
    }
    if (walk->scopes_used + words > walk->scopes_capacity) {
        size_t capacity = 2 * (walk->scopes_used + words) + 64;
        uint64_t *scopes = realloc(walk->scopes, capacity * sizeof *scopes);
        if (!scopes) return false;
        walk->scopes = scopes;
        walk->scopes_capacity = capacity;
    }
    return true;
}

/* Goes into a term of a union; the walk's scope and spot are those before the union. */
static bool take_term(pl_walk *walk, uint32_t node, uint32_t term, pl_error *error)
{
    if (!pl_path_push(&walk->path, walk->at.terms, term)) return pl_fail_memory(error, "walking the derivation");
    walk->path.length = ++walk->at.terms;
    pl_scope_term(&walk->scope, term);
    walk->next = walk->program->children[walk->program->nodes[node].as.union_.children_first + term];
    return true;
}

/* At a union: goes into the first term and leaves the others pending, or into the only one that is followed. */
static bool begin_union(pl_walk *walk, uint32_t node, pl_error *error)
{
    uint32_t count = walk->program->nodes[node].as.union_.children_count;
    walk->next = PL_NOWHERE;
    if (walk->follow) {
        uint32_t at = walk->at.terms;
        if (at >= walk->follow->length || walk->follow->terms[at] >= count)
            return pl_fail(error, PL_ERROR_ARGUMENT, "path", "the path doesn't exist in this scene");
        return take_term(walk, node, walk->follow->terms[at], error);
    }
    if (count == 0) return true;
    if (count > 1) {
        size_t words = pl_scope_words(walk->program, &walk->scope);
        if (!reserve(walk, words)) return pl_fail_memory(error, "walking the derivation");
        walk->pending[walk->pending_count++] = (pl_pending){node, 1, walk->at, walk->scopes_used};
        pl_scope_pack(walk->program, &walk->scope, walk->scopes + walk->scopes_used);
        walk->scopes_used += words;
    }
    return take_term(walk, node, 0, error);
}

/* Goes on with the next term of the innermost pending union. */
static bool next_term(pl_walk *walk, pl_error *error)
{
    pl_pending *pending = &walk->pending[walk->pending_count - 1];
    uint32_t node = pending->node, term = pending->term++;
    walk->at = pending->at;
    pl_scope_unpack(walk->program, walk->scopes + pending->scope, &walk->scope);
    if (pending->term == walk->program->nodes[node].as.union_.children_count) {
        walk->scopes_used = pending->scope;
        walk->pending_count--;
    }
    return take_term(walk, node, term, error);
}

/* --- one node --- */

static bool enter_symbol(pl_walk *walk, uint32_t node, pl_error *error)
{
    if (++walk->at.depth > PL_LIMIT_DEPTH)
        return pl_fail_at(error, PL_ERROR_LIMIT, walk->program, node,
                          "depth: %s is still being derived %d symbols deep, which is the limit; does its recursion end?",
                          walk->program->strings[walk->program->nodes[node].as.symbol.name].text, PL_LIMIT_DEPTH);
    pl_scope_enter(walk->program, node, &walk->scope);
    walk->at.symbol = node;
    walk->next = walk->program->nodes[node].as.symbol.body;
    return true;
}

/* A transformation with arguments: runs it and inverts it. */
static bool compute_transform(pl_walk *walk, uint32_t node, pl_error *error)
{
    const pl_node *it = &walk->program->nodes[node];
    const pl_transform *kept = walk->memo ? pl_memo_find(walk->memo, node, walk->scope.parameters) : NULL;
    walk->transform = &walk->computed;
    if (kept) {
        walk->computed = *kept;
        return true;
    }
    if (!pl_run(walk->program, node, it->as.transform_code.code, &walk->scope, &walk->result, error)) return false;
    pl_transform_set(&walk->computed, &walk->result.matrix);
    if (walk->stretches) walk->computed.stretch = pl_largest_stretch(&walk->computed.to_parent);
    if (walk->memo) pl_memo_keep(walk->memo, &walk->computed);
    return true;
}

static bool compute_arguments(pl_walk *walk, uint32_t node, pl_error *error)
{
    const pl_node *it = &walk->program->nodes[node];
    walk->shape = it->as.primitive.shape;
    memset(walk->arguments, 0, sizeof walk->arguments);
    if (!it->as.primitive.code) return true;
    if (!pl_run(walk->program, node, it->as.primitive.code, &walk->scope, &walk->result, error)) return false;
    for (uint32_t i = 0; i < walk->result.count && i < PL_SHAPE_ARGUMENTS; i++)
        walk->arguments[i] = walk->result.values[i];
    const pl_shape *shape = pl_shape_of(walk->shape);
    const char *wrong = shape->check ? shape->check(walk->arguments) : NULL;
    if (wrong) {
        char number[PL_NUMBER_TEXT];
        return pl_fail_at(error, PL_ERROR_SCENE, walk->program, node, "%s, not %s", wrong,
                          pl_number_text(walk->arguments[0], number));
    }
    return true;
}

/* The texture's code runs here only for its draws, which move the ordinals of those after it. */
static bool draw_texture(pl_walk *walk, uint32_t node, pl_error *error)
{
    const pl_node *it = &walk->program->nodes[node];
    const pl_record *record = &walk->program->records[it->as.texture.texture];
    if (!it->as.texture.draws || walk->follow) return true;
    double *values = malloc(record->size * sizeof *values);
    if (!values) return pl_fail_memory(error, "walking the derivation");
    walk->result.texture = values;
    bool ok = pl_run(walk->program, node, it->as.texture.code, &walk->scope, &walk->result, error);
    walk->result.texture = NULL;
    free(values);
    return ok;
}

static bool is_announced(uint8_t kind)
{
    return kind == PL_NODE_SYMBOL || kind == PL_NODE_TRANSFORM || kind == PL_NODE_TRANSFORM_CODE ||
           kind == PL_NODE_UNION || kind == PL_NODE_PRIMITIVE || kind == PL_NODE_MESH;
}

/* Drops the subtree of a singular transformation. */
static bool drop_singular(pl_walk *walk)
{
    if (!walk->transform->singular) return false;
    walk->singular++;
    walk->next = PL_NOWHERE;
    return true;
}

/* Does one node; *event stays PL_EVENT_END where there is nothing to report. */
static bool do_node(pl_walk *walk, uint32_t node, pl_event *event, pl_error *error)
{
    const pl_program *program = walk->program;
    const pl_node *it = &program->nodes[node];
    uint32_t child;
    walk->next = PL_NOWHERE;
    switch (it->kind) {
    case PL_NODE_EMPTY: return true;
    case PL_NODE_SYMBOL: return enter_symbol(walk, node, error);
    case PL_NODE_RULE:
        walk->at.rule = (int32_t)it->as.rule.index;
        walk->next = it->as.rule.body;
        return true;
    case PL_NODE_BRANCH:
        if (!pl_branch(program, node, &walk->scope, &child, error)) return false;
        walk->next = child;
        return true;
    case PL_NODE_CHOOSE:
        if (!pl_choose(program, node, &walk->scope, &child, error)) return false;
        walk->next = child;
        return true;
    case PL_NODE_CALCULATE:
        walk->next = it->as.calculate.child;
        return pl_run(program, node, it->as.calculate.code, &walk->scope, &walk->result, error);
    case PL_NODE_TRANSFORM:
        walk->transform = &program->transforms[it->as.transform.matrix];
        if (drop_singular(walk)) return true;
        walk->next = it->as.transform.child;
        *event = PL_EVENT_TRANSFORM;
        return true;
    case PL_NODE_TRANSFORM_CODE:
        if (!compute_transform(walk, node, error)) return false;
        if (drop_singular(walk)) return true;
        walk->next = it->as.transform_code.child;
        *event = PL_EVENT_TRANSFORM;
        return true;
    case PL_NODE_TEXTURE:
        walk->next = it->as.texture.child;
        *event = PL_EVENT_TEXTURE;
        return draw_texture(walk, node, error);
    case PL_NODE_UNION: return begin_union(walk, node, error);
    case PL_NODE_ENTER:
        walk->next = it->as.enter.symbol;
        *event = PL_EVENT_ENTER;
        return true;
    case PL_NODE_PRIMITIVE:
        *event = PL_EVENT_PRIMITIVE;
        return compute_arguments(walk, node, error);
    case PL_NODE_MESH:
        walk->mesh = it->as.mesh.mesh;
        *event = PL_EVENT_MESH;
        return true;
    case PL_NODE_OBJECT:
        pl_scope_object(program, node, &walk->scope);
        walk->next = it->as.object.child;
        return true;
    default:
        walk->at.no_shadow = true;
        walk->next = it->as.no_shadow.child;
        return true;
    }
}

pl_event pl_walk_next(pl_walk *walk, pl_error *error)
{
    for (;;) {
        if (walk->next == PL_NOWHERE) {
            walk->announced = false;
            if (walk->pending_count == 0) return PL_EVENT_END;
            if (!next_term(walk, error)) return PL_EVENT_ERROR;
        }
        uint32_t node = (uint32_t)walk->next;
        walk->node = node;
        if (walk->announce && !walk->announced && is_announced(walk->program->nodes[node].kind)) {
            walk->announced = true;
            return PL_EVENT_NODE;
        }
        walk->announced = false;
        pl_event event = PL_EVENT_END;
        if (!do_node(walk, node, &event, error)) return PL_EVENT_ERROR;
        if (event != PL_EVENT_END) return event;
    }
}
