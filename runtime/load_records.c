/* load_records.c - the records and meshes of bytecode (see reader.h). */
#include <string.h>

#include "random.h"
#include "reader.h"
#include "table.h"

/* --- records --- */

static void read_record(pl_reader *r, pl_record *record, size_t *numbers_total)
{
    const uint32_t kind = pl_read_u(r);
    const pl_record_row *row = pl_record_row_of(kind);
    const uint32_t entries = pl_read_u(r);
    if (r->failed)
        return;
    if (!row->name) {
        pl_read_fail(r, "there is no record kind %u", kind);
        return;
    }
    if (entries > 0 && row->entry == 0) {
        pl_read_fail(r, "a %s record has no entries, not %u", row->name, entries);
        return;
    }
    const uint64_t size = row->values + (uint64_t)entries * row->entry;
    *numbers_total += size < PL_LIMIT_RECORD_NUMBERS ? size : PL_LIMIT_RECORD_NUMBERS + 1;
    if (*numbers_total > PL_LIMIT_RECORD_NUMBERS) {
        pl_read_fail_as(r, PL_ERROR_LIMIT, "more than %d numbers in records", PL_LIMIT_RECORD_NUMBERS);
        return;
    }
    double *values = pl_read_allocate(r, size, sizeof *values);
    if (r->failed)
        return;
    memcpy(values, row->defaults, row->values * sizeof *values);
    const uint32_t sets = pl_read_count(r, 2);
    uint64_t next = 0; /* the smallest index that may follow */
    for (uint32_t i = 0; i < sets && !r->failed; i++) {
        const uint64_t index = next + pl_read_u(r);
        const uint32_t constant = pl_read_index(r, r->program->constant_count, "constant");
        if (!r->failed && index >= size)
            pl_read_fail(r, "value %llu of a %s record with %llu", (unsigned long long)index, row->name,
                         (unsigned long long)size);
        if (!r->failed)
            values[index] = r->program->constants[constant];
        next = index + 1;
    }
    *record = (pl_record){.kind = kind, .entries = entries, .size = (uint32_t)size, .values = values};
}

void pl_read_records(pl_reader *r)
{
    pl_program *program = r->program;
    const uint32_t count = pl_read_count(r, 3);
    pl_record *records = pl_read_allocate(r, count, sizeof *records);
    const double **lights = pl_read_allocate(r, count, sizeof *lights);
    const double *defaults = pl_record_row_of(PL_RECORD_SETTINGS)->defaults;
    size_t numbers_total = 0;
    program->settings = defaults;
    for (uint32_t i = 0; i < count && !r->failed; i++) {
        read_record(r, &records[i], &numbers_total);
        if (r->failed)
            return;
        const double *values = records[i].values;
        if (records[i].kind == PL_RECORD_SETTINGS) {
            if (program->settings != defaults)
                pl_read_fail(r, "two settings records");
            program->settings = values;
        } else if (records[i].kind == PL_RECORD_CAMERA) {
            if (program->camera)
                pl_read_fail(r, "two camera records");
            program->camera = values;
        } else if (records[i].kind == PL_RECORD_LIGHT) {
            lights[program->light_count++] = values;
        }
    }
    program->records = records;
    program->record_count = count;
    program->lights = lights;
    program->seed_key = pl_seed_key(program->settings[PL_SETTINGS_SEED]);
}

/* --- meshes --- */

static const double *read_vectors(pl_reader *r, uint32_t count)
{
    if (!r->failed && count > pl_read_left(r) / 24)
        pl_read_fail(r, "a mesh says it has %u vectors, more than fit into its bytes", count);
    double *vectors = pl_read_allocate(r, (size_t)count * 3, sizeof *vectors);
    for (size_t i = 0; i < (size_t)count * 3 && !r->failed; i++)
        vectors[i] = pl_read_f64(r);
    return vectors;
}

static void read_mesh(pl_reader *r, pl_mesh *mesh)
{
    mesh->name = pl_read_index(r, r->program->string_count, "name");
    mesh->vertex_count = pl_read_u(r);
    mesh->normal_count = pl_read_u(r);
    mesh->triangle_count = pl_read_u(r);
    mesh->vertices = read_vectors(r, mesh->vertex_count);
    mesh->normals = read_vectors(r, mesh->normal_count);
    if (!r->failed && mesh->triangle_count > pl_read_left(r) / (mesh->normal_count ? 6 : 3))
        pl_read_fail(r, "a mesh says it has %u triangles, more than fit into its bytes", mesh->triangle_count);
    uint32_t *triangles = pl_read_allocate(r, (size_t)mesh->triangle_count * 3, sizeof *triangles);
    uint32_t *normals =
        mesh->normal_count ? pl_read_allocate(r, (size_t)mesh->triangle_count * 3, sizeof *normals) : NULL;
    for (size_t i = 0; i < mesh->triangle_count && !r->failed; i++) {
        for (int k = 0; k < 3; k++)
            triangles[3 * i + k] = pl_read_index(r, mesh->vertex_count, "vertex");
        for (int k = 0; k < 3 && normals; k++)
            normals[3 * i + k] = pl_read_index(r, mesh->normal_count, "normal");
    }
    mesh->triangles = triangles;
    mesh->normal_triangles = normals;
    if (!mesh->normal_count)
        mesh->normals = NULL;
}

void pl_read_meshes(pl_reader *r)
{
    const uint32_t count = pl_read_count(r, 4);
    pl_mesh *meshes = pl_read_allocate(r, count, sizeof *meshes);
    for (uint32_t i = 0; i < count && !r->failed; i++)
        read_mesh(r, &meshes[i]);
    r->program->meshes = meshes;
    r->program->mesh_count = count;
}
