/* plsys-rt - draws a compiled scene without Python: bytecode in, picture out.
 *
 *     plsys compile tree.plsys -o tree.plsb
 *     plsys-rt tree.plsb -o tree.pfm --size 640x480
 *     plsys-rt tree.plsb --dump
 *
 * The picture is a portable float map: linear rgb, 32-bit floats, unclipped. Exit codes: 0 fine, 2 bad input, with one
 * message on standard error and no output file. */
#include <errno.h>
#include <fcntl.h>
#include <signal.h>
#include <stdarg.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "plsys.h"

static const char usage[] =
    "usage: plsys-rt SCENE.plsb -o OUT.pfm [options]\n"
    "       plsys-rt SCENE.plsb --dump\n"
    "\n"
    "Draws a compiled scene (`plsys compile`) into a portable float map: linear rgb, unclipped.\n"
    "\n"
    "  -o OUT.pfm          the picture\n"
    "  --size WxH          in pixels (640x480)\n"
    "  --threads N         1 to 1024 (one a core)\n"
    "  --accel A           auto, none, boxes, grid or bvh: same picture, different speed (auto)\n"
    "  --memory SIZE       of states and structures: 64K, 1M, 2G (by the caches)\n"
    "  --front K           at most K items in a front of bvh, or all (by the memory)\n"
    "  --grid NxMxK        voxels of --accel grid (16x16x8)\n"
    "  --antialias A       off, grid=N (centre and NxN sub-cells) or adaptive=DEPTH (off)\n"
    "  --detail PX         draw what is smaller than PX pixels as a box, 0: nothing (0; 0.5 where a recursion has no end)\n"
    "  --povray-epsilon    POV-Ray's hit and shadow tolerances\n"
    "  --dump              print the bytecode as text instead\n"
    "  --help              this text\n";

typedef struct arguments {
    const char *scene, *output;
    bool dump;
    pl_options options;
    pl_render_options render;
} arguments;

__attribute__((format(printf, 1, 2))) static bool complain(const char *format, ...)
{
    va_list list;
    va_start(list, format);
    fputs("plsys-rt: error: ", stderr);
    vfprintf(stderr, format, list);
    fputc('\n', stderr);
    va_end(list);
    return false;
}

/* A whole number of [low, high] that ends at `end`. */
static bool parse_number(const char *text, char end, long low, long high, int *number, const char **rest)
{
    char *after;
    if (*text < '0' || *text > '9') return false;
    errno = 0;
    long value = strtol(text, &after, 10);
    if (errno || *after != end || value < low || value > high) return false;
    *number = (int)value;
    if (rest) *rest = after + 1;
    return true;
}

static bool parse_antialias(const char *text, pl_render_options *render)
{
    if (strcmp(text, "off") == 0) return true;
    if (strncmp(text, "grid=", 5) == 0) {
        render->antialias = PL_AA_GRID;
        return parse_number(text + 5, '\0', 1, 256, &render->samples, NULL);
    }
    render->antialias = PL_AA_ADAPTIVE;
    render->threshold = 0.3;
    return strncmp(text, "adaptive=", 9) == 0 && parse_number(text + 9, '\0', 1, 9, &render->samples, NULL);
}

static bool parse_accelerator(const char *text, int *accelerator)
{
    static const char *const names[] = {"auto", "none", "boxes", "bvh", "grid"};
    for (int i = 0; i < 5; i++)
        if (strcmp(text, names[i]) == 0) {
            *accelerator = i;
            return true;
        }
    return false;
}

/* Pixels, of which pl_options takes 0 for automatic and less for none. */
static bool parse_detail(const char *text, double *detail)
{
    char *after;
    double pixels = strtod(text, &after);
    if (after == text || *after || !(pixels >= 0.0 && pixels <= 1e6)) return false;
    *detail = pixels > 0.0 ? pixels : -1.0;
    return true;
}

/* Bytes, with K, M, G and T for powers of 1024. */
static bool parse_size(const char *text, size_t *size)
{
    static const char units[] = "KMGT";
    char *after;
    double value = strtod(text, &after);
    if (after == text) return false;
    const char *unit = *after ? strchr(units, *after) : NULL;
    if (*after && (!unit || after[1])) return false;
    for (long i = unit ? unit - units : -1; i >= 0; i--) value *= 1024.0;
    if (!(value >= 1.0 && value < 0x1p62)) return false;
    *size = (size_t)value;
    return true;
}

static bool parse_front(const char *text, uint64_t *items)
{
    char *after;
    *items = UINT64_MAX;
    if (strcmp(text, "all") == 0) return true;
    if (*text < '0' || *text > '9') return false;
    errno = 0;
    *items = strtoull(text, &after, 10);
    return !errno && !*after && *items > 0;
}

static bool parse_grid(const char *text, uint32_t grid[3])
{
    int sides[3];
    if (!parse_number(text, 'x', 1, 4096, &sides[0], &text) || !parse_number(text, 'x', 1, 4096, &sides[1], &text) ||
        !parse_number(text, '\0', 1, 4096, &sides[2], NULL))
        return false;
    for (int axis = 0; axis < 3; axis++) grid[axis] = (uint32_t)sides[axis];
    return true;
}

/* An option with a value. */
static bool parse_value(arguments *a, const char *option, const char *value)
{
    const char *rest;
    if (strcmp(option, "-o") == 0) {
        a->output = value;
        return true;
    }
    if (strcmp(option, "--size") == 0)
        return (parse_number(value, 'x', 1, 1 << 20, &a->render.width, &rest) &&
                parse_number(rest, '\0', 1, 1 << 20, &a->render.height, NULL)) ||
               complain("--size %s: expected WxH, such as 640x480", value);
    if (strcmp(option, "--threads") == 0)
        return parse_number(value, '\0', 1, 1024, &a->options.threads, NULL) ||
               complain("--threads %s: expected a number from 1 to 1024", value);
    if (strcmp(option, "--accel") == 0)
        return parse_accelerator(value, &a->options.accelerator) ||
               complain("--accel %s: expected auto, none, boxes, grid or bvh", value);
    if (strcmp(option, "--memory") == 0)
        return parse_size(value, &a->options.memory) || complain("--memory %s: expected a size, such as 64K, 1M or 2G", value);
    if (strcmp(option, "--front") == 0)
        return parse_front(value, &a->options.front_items) ||
               complain("--front %s: expected a number of items, 1 or more, or all", value);
    if (strcmp(option, "--grid") == 0)
        return parse_grid(value, a->options.grid) || complain("--grid %s: expected NxMxK, such as 16x16x8", value);
    if (strcmp(option, "--detail") == 0)
        return parse_detail(value, &a->options.detail) ||
               complain("--detail %s: expected a number of pixels, 0 or more", value);
    if (strcmp(option, "--antialias") == 0)
        return parse_antialias(value, &a->render) ||
               complain("--antialias %s: expected off, grid=N or adaptive=DEPTH", value);
    return complain("no option '%s'; see --help", option);
}

static bool parse(int argc, char **argv, arguments *a)
{
    for (int i = 1; i < argc; i++) {
        if (strcmp(argv[i], "--dump") == 0) {
            a->dump = true;
        } else if (strcmp(argv[i], "--povray-epsilon") == 0) {
            a->options.povray_epsilon = true;
        } else if (argv[i][0] == '-' && argv[i][1]) {
            if (i + 1 == argc) return complain("%s needs a value, or is no option; see --help", argv[i]);
            if (!parse_value(a, argv[i], argv[i + 1])) return false;
            i++;
        } else if (a->scene) {
            return complain("one scene at a time, not '%s' and '%s'", a->scene, argv[i]);
        } else {
            a->scene = argv[i];
        }
    }
    if (!a->scene) return complain("no scene given; see --help");
    if (!a->dump && !a->output) return complain("no picture given: -o OUT.pfm");
    return true;
}

/* --- files --- */

/* The bytes of a file; NULL after a message. */
static unsigned char *read_file(const char *path, size_t *length)
{
    size_t capacity = 1 << 16;
    unsigned char *bytes = NULL;
    FILE *file = fopen(path, "rb");
    *length = 0;
    while (file) {
        unsigned char *more = realloc(bytes, capacity);
        if (!more) {
            errno = ENOMEM;
            break;
        }
        bytes = more;
        *length += fread(bytes + *length, 1, capacity - *length, file);
        if (*length < capacity && !ferror(file)) {
            fclose(file);
            return bytes;
        }
        if (ferror(file)) break;
        capacity *= 2;
    }
    complain("%s can't be read: %s", path, strerror(errno));
    if (file) fclose(file);
    free(bytes);
    return NULL;
}

/* The file that a picture is written to before it takes its name; "": there is none. */
static char part[4096];

static void end_by_signal(int number)
{
    if (part[0]) unlink(part);
    signal(number, SIG_DFL);
    raise(number);
}

/* A new file beside `path`, under a name of its own: `part`. */
static FILE *create_beside(const char *path)
{
    for (int try = 0; try < 100; try++) {
        char name[sizeof part];
        if ((size_t)snprintf(name, sizeof name, "%s.%ld-%d.part", path, (long)getpid(), try) >= sizeof name) {
            errno = ENAMETOOLONG;
            return NULL;
        }
        int descriptor = open(name, O_WRONLY | O_CREAT | O_EXCL, 0666);
        if (descriptor >= 0) {
            memcpy(part, name, sizeof part);
            return fdopen(descriptor, "wb");
        }
        if (errno != EEXIST) return NULL;
    }
    return NULL;
}

/* What a picture is written to: a device or a pipe itself, which a file must not take the place of. */
static FILE *create(const char *path)
{
    struct stat there;
    if (stat(path, &there) == 0 && !S_ISREG(there.st_mode)) return fopen(path, "wb");
    const int signals[] = {SIGHUP, SIGINT, SIGTERM};
    for (size_t i = 0; i < sizeof signals / sizeof *signals; i++)
        if (signal(signals[i], end_by_signal) == SIG_IGN) signal(signals[i], SIG_IGN);
    return create_beside(path);
}

/* Rows from the bottom up; the -1 says little-endian. */
static bool write_pfm(FILE *file, const float *color, int width, int height)
{
    const uint32_t one = 1;
    bool little = *(const unsigned char *)&one == 1;
    fprintf(file, "PF\n%d %d\n%s\n", width, height, little ? "-1.0" : "1.0");
    for (int row = height; row-- > 0;)
        if (fwrite(color + (size_t)row * (size_t)width * 3, 3 * sizeof *color, (size_t)width, file) != (size_t)width)
            return false;
    return true;
}

/* --- drawing --- */

static int report(const arguments *a, const pl_error *error)
{
    bool in_source = error->code == PL_ERROR_SCENE && error->place[0];
    if (in_source) fprintf(stderr, "%s: error: %s\n", error->place, error->reason);
    else fprintf(stderr, "%s: error: %s%s%s\n", a->scene, error->place, error->place[0] ? ": " : "", error->reason);
    return 2;
}

static bool show_progress(void *context, double done)
{
    (void)context;
    fprintf(stderr, "\r%3.0f %%", 100.0 * done);
    return true;
}

static int dump(const arguments *a, const unsigned char *bytes, size_t length)
{
    pl_error error;
    char *text = pl_disassemble(bytes, length, &error);
    if (!text) return report(a, &error);
    bool written = fputs(text, stdout) >= 0 && fflush(stdout) == 0;
    pl_free(text);
    if (!written) complain("standard output can't be written: %s", strerror(errno));
    return written ? 0 : 2;
}

static int draw(arguments *a, const unsigned char *bytes, size_t length)
{
    pl_error error;
    pl_scene *scene = pl_scene_create(bytes, length, &a->options, &error);
    if (!scene) return report(a, &error);
    int status = 2;
    float *color = malloc((size_t)a->render.width * (size_t)a->render.height * 3 * sizeof *color);
    FILE *file = color ? create(a->output) : NULL;
    int create_error = errno;
    bool quiet = !isatty(STDERR_FILENO);
    if (!quiet) a->render.progress = show_progress;
    if (!color) {
        complain("there isn't enough memory for the picture");
    } else if (!file) {
        complain("%s can't be written: %s", a->output, strerror(create_error));
    } else {
        bool drawn = pl_render(scene, &a->render, &(pl_channels){.color = color}, &error);
        if (!quiet) fputs("\r     \r", stderr);
        bool written = drawn && write_pfm(file, color, a->render.width, a->render.height);
        written = fclose(file) == 0 && written && (!part[0] || rename(part, a->output) == 0);
        if (!drawn) report(a, &error);
        else if (!written) complain("%s can't be written: %s", a->output, strerror(errno));
        if (!written && part[0]) unlink(part);
        status = written ? 0 : 2;
    }
    free(color);
    pl_scene_destroy(scene);
    return status;
}

int main(int argc, char **argv)
{
    arguments a = {.render = {.width = 640, .height = 480}};
    for (int i = 1; i < argc; i++)
        if (strcmp(argv[i], "--help") == 0) return fputs(usage, stdout) < 0;
    if (!parse(argc, argv, &a)) return 2;
    size_t length;
    unsigned char *bytes = read_file(a.scene, &length);
    if (!bytes) return 2;
    int status = a.dump ? dump(&a, bytes, length) : draw(&a, bytes, length);
    free(bytes);
    return status;
}
