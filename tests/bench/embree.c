/* embree.c - the peer: traces rays with Embree, 3.13 or 4.4, and says how fast.
 *
 *     embree LIBRARY SCENE RAYS HITS [FLAGS]      FLAGS: of "cr" - compact, robust
 *
 * LIBRARY is opened at run time (libembree3.so.3, or pip embreex's libembree4); rtcore.h of 3.13 gives the types.
 * The two differ in how a ray is handed over and in fields at the end of a hit, for which room is left.
 * SCENE: u32 groups; each group u32 kind (0 triangles, 1 cone curves, 2 quads), u32 count, floats (9, 8 or 12 a primitive);
 * u32 instances; each u32 group, 12 floats (3x4, row by row). Without instances all groups are the scene.
 * RAYS: u32 sets; each u32 rays, u32 coherent, floats ox oy oz dx dy dz. Directions must have unit length: cone curves give
 * wrong hits otherwise, and so instances must not scale. HITS: t of every ray of every set, as floats.
 * It takes turns (turns.py): each line of standard input is the number of a set of rays, which is traced as packets and ray by
 * ray, and answered by a line of JSON with the rates, millions of rays a second. After the last turn comes a line about all. */
#include <dlfcn.h>
#include <embree3/rtcore.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

enum { TRIANGLES, CURVES, QUADS };

#define FUNCTIONS(F) \
    F(rtcNewDevice) F(rtcReleaseDevice) F(rtcGetDeviceProperty) F(rtcSetDeviceMemoryMonitorFunction) F(rtcGetDeviceError) \
    F(rtcNewScene) F(rtcReleaseScene) F(rtcSetSceneFlags) F(rtcSetSceneBuildQuality) F(rtcAttachGeometry) F(rtcCommitScene) \
    F(rtcNewGeometry) F(rtcReleaseGeometry) F(rtcCommitGeometry) F(rtcSetNewGeometryBuffer) \
    F(rtcSetGeometryInstancedScene) F(rtcSetGeometryTransform)

#define DECLARE(name) static __typeof__(name) *p_##name;
FUNCTIONS(DECLARE)

typedef void one_v3(RTCScene, struct RTCIntersectContext *, struct RTCRayHit *);
typedef void one_v4(RTCScene, struct RTCRayHit *, void *);
typedef void many_v3(const int *, RTCScene, struct RTCIntersectContext *, void *);
typedef void many_v4(const int *, RTCScene, void *, void *);

/* The beginning of 4.4's RTCIntersectArguments, with room. */
static struct {
    unsigned flags, features;
    char room[120];
} arguments4 = {.features = 0xFFFFFFFFu};

static void *one, *many8, *many16;
static int version;
static long long bytes;

typedef struct set {
    unsigned count, coherent;
    float *rays, *t;
} set;

/* Room for what 4.4 has at the end of a hit. */
typedef union hit1 {
    struct RTCRayHit ray;
    char room[128];
} hit1;
typedef union hit8 {
    struct RTCRayHit8 ray;
    char room[sizeof(struct RTCRayHit8) + 64];
} hit8;
typedef union hit16 {
    struct RTCRayHit16 ray;
    char room[sizeof(struct RTCRayHit16) + 128];
} hit16;

static double now(void)
{
    struct timespec t;
    clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &t); /* one thread: other programs on the machine don't count */
    return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

static void fail(const char *what)
{
    fprintf(stderr, "embree: %s\n", what);
    exit(1);
}

static bool count_bytes(void *context, ssize_t change, bool after)
{
    (void)context;
    (void)after;
    bytes += change;
    return true;
}

static void open_library(const char *path)
{
    void *library = dlopen(path, RTLD_NOW);
    if (!library) fail(dlerror());
#define LOAD(name) \
    if (!(*(void **)&p_##name = dlsym(library, #name))) fail(#name " is missing");
    FUNCTIONS(LOAD)
    one = dlsym(library, "rtcIntersect1");
    many8 = dlsym(library, "rtcIntersect8");
    many16 = dlsym(library, "rtcIntersect16");
    if (!one || !many8 || !many16) fail("the functions that intersect are missing");
}

static void take(void *data, size_t size, FILE *file)
{
    if (fread(data, 1, size, file) != size) fail("a file ends early");
}

static unsigned take_number(FILE *file)
{
    unsigned number;
    take(&number, sizeof number, file);
    return number;
}

static RTCGeometry read_group(RTCDevice device, FILE *file)
{
    unsigned kind = take_number(file), count = take_number(file);
    static const enum RTCGeometryType types[] = {RTC_GEOMETRY_TYPE_TRIANGLE, RTC_GEOMETRY_TYPE_CONE_LINEAR_CURVE,
                                                 RTC_GEOMETRY_TYPE_QUAD};
    static const unsigned corners[] = {3, 2, 4};
    RTCGeometry geometry = p_rtcNewGeometry(device, types[kind]);
    size_t floats = kind == CURVES ? 4 : 3, vertices = (size_t)count * corners[kind];
    float *vertex = p_rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_VERTEX, 0,
                                              kind == CURVES ? RTC_FORMAT_FLOAT4 : RTC_FORMAT_FLOAT3,
                                              floats * sizeof(float), vertices);
    take(vertex, vertices * floats * sizeof(float), file);
    unsigned each = kind == CURVES ? 1 : corners[kind];
    unsigned *index = p_rtcSetNewGeometryBuffer(
        geometry, RTC_BUFFER_TYPE_INDEX, 0,
        kind == CURVES ? RTC_FORMAT_UINT : kind == QUADS ? RTC_FORMAT_UINT4 : RTC_FORMAT_UINT3, each * sizeof(unsigned), count);
    for (unsigned i = 0; i < count; i++)
        for (unsigned k = 0; k < each; k++) index[i * each + k] = i * corners[kind] + k;
    p_rtcCommitGeometry(geometry);
    return geometry;
}

static RTCScene new_scene(RTCDevice device, const char *flags)
{
    RTCScene scene = p_rtcNewScene(device);
    int bits = 0;
    if (strchr(flags, 'c')) bits |= RTC_SCENE_FLAG_COMPACT;
    if (strchr(flags, 'r')) bits |= RTC_SCENE_FLAG_ROBUST;
    p_rtcSetSceneFlags(scene, bits);
    p_rtcSetSceneBuildQuality(scene, RTC_BUILD_QUALITY_HIGH);
    return scene;
}

static RTCScene read_scene(RTCDevice device, const char *path, const char *flags)
{
    FILE *file = fopen(path, "rb");
    if (!file) fail("the scene can't be opened");
    unsigned groups = take_number(file);
    RTCGeometry *geometries = calloc(groups, sizeof *geometries);
    for (unsigned i = 0; i < groups; i++) geometries[i] = read_group(device, file);
    unsigned instances = take_number(file);
    RTCScene scene = new_scene(device, flags), *below = calloc(groups, sizeof *below);
    for (unsigned i = 0; i < groups; i++) {
        RTCScene target = scene;
        if (instances) target = below[i] = new_scene(device, flags);
        p_rtcAttachGeometry(target, geometries[i]);
        p_rtcReleaseGeometry(geometries[i]);
        if (instances) p_rtcCommitScene(target);
    }
    for (unsigned i = 0; i < instances; i++) {
        unsigned group = take_number(file);
        float matrix[12];
        take(matrix, sizeof matrix, file);
        RTCGeometry instance = p_rtcNewGeometry(device, RTC_GEOMETRY_TYPE_INSTANCE);
        p_rtcSetGeometryInstancedScene(instance, below[group]);
        p_rtcSetGeometryTransform(instance, 0, RTC_FORMAT_FLOAT3X4_ROW_MAJOR, matrix);
        p_rtcCommitGeometry(instance);
        p_rtcAttachGeometry(scene, instance);
        p_rtcReleaseGeometry(instance);
    }
    p_rtcCommitScene(scene);
    fclose(file);
    return scene;
}

static unsigned read_rays(const char *path, set **sets)
{
    FILE *file = fopen(path, "rb");
    if (!file) fail("the rays can't be opened");
    unsigned count = take_number(file);
    *sets = calloc(count, sizeof **sets);
    for (unsigned i = 0; i < count; i++) {
        set *s = *sets + i;
        s->count = take_number(file);
        s->coherent = take_number(file);
        s->rays = malloc(6 * sizeof(float) * s->count);
        s->t = malloc(sizeof(float) * s->count);
        take(s->rays, 6 * sizeof(float) * s->count, file);
    }
    fclose(file);
    return count;
}

static void single(RTCScene scene, set *s, struct RTCIntersectContext *context)
{
    for (unsigned i = 0; i < s->count; i++) {
        const float *r = s->rays + 6 * (size_t)i;
        _Alignas(64) hit1 h;
        h.ray.ray = (struct RTCRay){.org_x = r[0], .org_y = r[1], .org_z = r[2], .dir_x = r[3], .dir_y = r[4], .dir_z = r[5],
                                    .tfar = 1e30f, .mask = 0xFFFFFFFFu};
        h.ray.hit.geomID = h.ray.hit.instID[0] = RTC_INVALID_GEOMETRY_ID;
        if (version == 3) ((one_v3 *)one)(scene, context, &h.ray);
        else ((one_v4 *)one)(scene, &h.ray, &arguments4);
        s->t[i] = h.ray.hit.geomID == RTC_INVALID_GEOMETRY_ID ? 1e30f : h.ray.ray.tfar;
    }
}

#define PACKETS(name, type, width, function)                                                                          \
    static void name(RTCScene scene, set *s, struct RTCIntersectContext *context)                                     \
    {                                                                                                                  \
        _Alignas(64) int valid[width];                                                                                 \
        for (unsigned first = 0; first < s->count; first += width) {                                                   \
            _Alignas(64) type h;                                                                                       \
            for (unsigned k = 0; k < width; k++) {                                                                     \
                unsigned i = first + k < s->count ? first + k : s->count - 1;                                          \
                const float *r = s->rays + 6 * (size_t)i;                                                              \
                valid[k] = -1;                                                                                         \
                h.ray.ray.org_x[k] = r[0], h.ray.ray.org_y[k] = r[1], h.ray.ray.org_z[k] = r[2];                       \
                h.ray.ray.dir_x[k] = r[3], h.ray.ray.dir_y[k] = r[4], h.ray.ray.dir_z[k] = r[5];                       \
                h.ray.ray.tnear[k] = h.ray.ray.time[k] = 0.0f, h.ray.ray.tfar[k] = 1e30f;                              \
                h.ray.ray.mask[k] = 0xFFFFFFFFu, h.ray.ray.flags[k] = h.ray.ray.id[k] = 0;                             \
                h.ray.hit.geomID[k] = h.ray.hit.instID[0][k] = RTC_INVALID_GEOMETRY_ID;                                \
            }                                                                                                          \
            if (version == 3) ((many_v3 *)function)(valid, scene, context, &h);                                        \
            else ((many_v4 *)function)(valid, scene, &h, &arguments4);                                                          \
            for (unsigned k = 0; k < width && first + k < s->count; k++)                                               \
                s->t[first + k] = h.ray.hit.geomID[k] == RTC_INVALID_GEOMETRY_ID ? 1e30f : h.ray.ray.tfar[k];          \
        }                                                                                                              \
    }
PACKETS(packets8, hit8, 8, many8)
PACKETS(packets16, hit16, 16, many16)

/* The rate of a set, as a member of a JSON object. */
static void measure(const char *name, void (*run)(RTCScene, set *, struct RTCIntersectContext *), RTCScene scene, set *s,
                    const char *end)
{
    struct RTCIntersectContext context;
    rtcInitIntersectContext(&context);
    if (s->coherent) context.flags = RTC_INTERSECT_CONTEXT_FLAG_COHERENT;
    arguments4.flags = s->coherent ? 1u << 16 : 0; /* RTC_RAY_QUERY_FLAG_COHERENT */
    double start = now();
    run(scene, s, &context);
    printf("\"%s\": %.4f%s", name, 1e-6 * s->count / (now() - start), end);
}

/* A turn for each line of standard input. */
static void take_turns(RTCScene scene, set *sets, unsigned count)
{
    unsigned number;
    while (scanf("%u", &number) == 1) {
        if (number >= count) fail("no such set of rays");
        printf("{");
        measure("packets8", packets8, scene, &sets[number], ", ");
        measure("packets16", packets16, scene, &sets[number], ", ");
        measure("single", single, scene, &sets[number], "}\n");
        fflush(stdout);
    }
}

int main(int argc, char **argv)
{
    if (argc < 5) fail("embree LIBRARY SCENE RAYS HITS [FLAGS]");
    open_library(argv[1]);
    RTCDevice device = p_rtcNewDevice("threads=1,set_affinity=0");
    if (!device) fail("no device");
    long number = p_rtcGetDeviceProperty(device, RTC_DEVICE_PROPERTY_VERSION);
    version = (int)(number / 10000);
    p_rtcSetDeviceMemoryMonitorFunction(device, count_bytes, NULL);
    double start = now();
    RTCScene scene = read_scene(device, argv[2], argc > 5 ? argv[5] : "");
    double build = now() - start;
    set *sets;
    unsigned count = read_rays(argv[3], &sets);
    take_turns(scene, sets, count);
    printf("{\"version\": \"%ld.%ld.%ld\", \"build_seconds\": %.4f, \"bytes\": %lld, \"error\": %d}\n", number / 10000,
           number / 100 % 100, number % 100, build, bytes, p_rtcGetDeviceError(device));
    FILE *file = fopen(argv[4], "wb");
    if (!file) fail("the hits can't be written");
    for (unsigned i = 0; i < count; i++) fwrite(sets[i].t, sizeof(float), sets[i].count, file);
    fclose(file);
    p_rtcReleaseScene(scene);
    p_rtcReleaseDevice(device);
    return 0;
}
