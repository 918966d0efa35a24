/* damper.txt: words and numbers, separated by white space, in this order:
 *
 *   damperfit-damper 3
 *   token TEXT
 *   purdy a_p1 a_p2 a_r V_10 V_20 V_g0 rho_0 rod_force
 *   solver tolerance max_steps
 *   tested stroke speed
 *   friction_band width
 *   start SETTING
 *   settings N
 *   SETTING R_m1 R_m2 R_m3 K_e f_f f_0 P_0 gamma k_s play tare lag moving_mass    (N times; the last five are
 *                                                    the rig's)
 *
 * and of a damper of valves, in place of the line `purdy`:
 *
 *   network a_1 a_2 V_1 V_2 rho_0 rod_force rounding has_floating_piston n_passages n_numbers
 *   from to p_open R S width power two_way            (n_passages times)
 *
 * Numbers have a point, whatever the locale of the host says.
 */
#include "reading.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#ifdef _WIN32
#include <windows.h>
#endif

#define FILE_NAME "damper.txt"
enum { LONGEST_FILE = 4000000, MOST_SETTINGS = 100000 };

typedef struct {
    const char *at;
    int is_good;
} cursor;

static int is_space(char c)
{
    return c == ' ' || c == '\t' || c == '\n' || c == '\r';
}

static size_t next_word(cursor *c, const char **word)
{
    size_t n = 0;
    while (is_space(*c->at))
        c->at++;
    *word = c->at;
    while (c->at[n] != '\0' && !is_space(c->at[n]))
        n++;
    c->at += n;
    return n;
}

static void expect(cursor *c, const char *name)
{
    const char *word;
    const size_t n = next_word(c, &word);
    if (n != strlen(name) || strncmp(word, name, n) != 0)
        c->is_good = 0;
}

/* strtod would take the locale's decimal mark. Digits are gathered in an integer and scaled once, by
 * a power of ten that is exact up to 22; a file has seventeen digits at most. */
static double read_number(cursor *c)
{
    const char *p;
    size_t n = next_word(c, &p);
    char text[64], *end;
    if (n == 0 || n >= sizeof text) {
        c->is_good = 0;
        return 0.0;
    }
    memcpy(text, p, n);
    text[n] = '\0';
    double value = strtod(text, &end);
    if (*end == '.') { /* the host's mark is another one */
        char mark[8];
        snprintf(mark, sizeof mark, "%.1f", 0.5);
        *end = mark[1];
        value = strtod(text, &end);
    }
    if (*end != '\0' || !isfinite(value))
        c->is_good = 0;
    return value;
}

static int read_whole(cursor *c, int low, int high)
{
    const double value = read_number(c);
    if (!(value >= low && value <= high) || value != floor(value)) {
        c->is_good = 0;
        return low;
    }
    return (int)value;
}

static void read_sizes(cursor *c, double *const sizes[], size_t n)
{
    for (size_t i = 0; i < n; i++)
        *sizes[i] = read_number(c);
}

static void read_purdy(cursor *c, ex_damper *d)
{
    static const int ways[3][4] = {{1, 3, 1, DF_S}, {2, 1, 0, DF_R}, {3, 2, 0, DF_R}}; /* one term each */
    static const int places[] = {DF_FIRST_PASSAGE_NUMBER, DF_FIRST_PASSAGE_NUMBER + 1, DF_FIRST_PASSAGE_NUMBER + 2,
                                 DF_NUMBER_K, DF_NUMBER_FRICTION, DF_NUMBER_OFFSET, DF_NUMBER_P_0, DF_NUMBER_GAMMA};
    df_network *q = &d->network;
    double rod; /* the difference of the areas */
    double *const sizes[] = {&q->a_1, &q->a_2, &rod, &q->V_1, &q->V_2, &q->numbers[DF_NUMBER_V_GAS], &q->rho_0,
                             &q->rod_force};
    read_sizes(c, sizes, sizeof sizes / sizeof *sizes);
    q->rounding = 1.0; /* Pa, as the model that fits has it */
    q->n_passages = 3;
    for (int k = 0; k < 3; k++) {
        df_passage *p = &q->passages[k];
        p->from = ways[k][0];
        p->to = ways[k][1];
        p->two_way = ways[k][2];
        for (int i = 0; i < DF_TERMS; i++)
            p->places[i] = i == ways[k][3] ? DF_FIRST_PASSAGE_NUMBER + k : -1;
    }
    q->n_numbers = DF_FIRST_PASSAGE_NUMBER + 3;
    memcpy(d->places, places, sizeof places);
    d->n_numbers = (int)(sizeof places / sizeof *places);
}

static void read_network(cursor *c, ex_damper *d)
{
    df_network *q = &d->network;
    double *const sizes[] = {&q->a_1, &q->a_2, &q->V_1, &q->V_2, &q->rho_0, &q->rod_force, &q->rounding};
    read_sizes(c, sizes, sizeof sizes / sizeof *sizes);
    q->has_floating_piston = read_whole(c, 0, 1);
    q->n_passages = read_whole(c, 1, DF_MOST_PASSAGES);
    q->n_numbers = read_whole(c, DF_FIRST_PASSAGE_NUMBER, DF_MOST_NUMBERS);
    for (int k = 0; k < q->n_passages; k++) {
        df_passage *p = &q->passages[k];
        p->from = read_whole(c, 1, 3);
        p->to = read_whole(c, 1, 3);
        for (int i = 0; i < DF_TERMS; i++)
            p->places[i] = read_whole(c, -1, q->n_numbers - 1);
        p->two_way = read_whole(c, 0, 1);
    }
    d->is_network = 1;
    d->n_numbers = q->n_numbers;
    for (int k = 0; k < d->n_numbers; k++)
        d->places[k] = k;
}

static void read_body(cursor *c, ex_damper *d)
{
    const char *word;
    expect(c, "damperfit-damper");
    expect(c, "3");
    expect(c, "token");
    const size_t n = next_word(c, &word);
    if (n >= EX_TOKEN) {
        c->is_good = 0;
        return;
    }
    memcpy(d->token, word, n);
    d->token[n] = '\0';
    const size_t m = next_word(c, &word);
    if (m == 7 && strncmp(word, "network", m) == 0)
        read_network(c, d);
    else if (m == 5 && strncmp(word, "purdy", m) == 0)
        read_purdy(c, d);
    else
        c->is_good = 0;
    expect(c, "solver");
    d->options.tolerance = read_number(c);
    d->options.max_steps_per_sample = read_whole(c, 1, 1000000000);
    expect(c, "tested");
    d->stroke = read_number(c);
    d->speed = read_number(c);
    expect(c, "friction_band");
    d->friction_band = read_number(c);
    d->options.dead_band = d->friction_band;
}

/* With a floating piston chamber 2 is at the gas pressure; friction is a state where it pre-slides. */
static void number_states(ex_damper *d)
{
    d->slots[d->n_states++] = EX_OIL_1;
    if (!d->network.has_floating_piston)
        d->slots[d->n_states++] = EX_OIL_2;
    d->slots[d->n_states++] = EX_OUTSIDE;
    if (ex_has_grip(d))
        d->slots[d->n_states++] = EX_GRIPS;
}

int ex_parse(const char *text, ex_damper *d, char *why)
{
    cursor c = {text, 1};
    memset(d, 0, sizeof *d);
    read_body(&c, d);
    expect(&c, "start");
    const int start = read_whole(&c, -1000000, 1000000);
    expect(&c, "settings");
    const int n = read_whole(&c, 1, MOST_SETTINGS);
    if (c.is_good) {
        d->settings = calloc((size_t)n, sizeof *d->settings);
        d->table = calloc((size_t)n * (size_t)d->n_numbers, sizeof *d->table);
        d->rig = calloc((size_t)n * EX_RIG, sizeof *d->rig);
    }
    if (!d->settings || !d->table || !d->rig) {
        snprintf(why, EX_WHY, "%s", c.is_good ? "out of memory" : FILE_NAME " is damaged at its head");
        return 0;
    }
    d->n_settings = n;
    d->start = -1;
    for (int i = 0; i < n; i++) {
        d->settings[i] = read_whole(&c, -1000000, 1000000);
        if (d->settings[i] == start)
            d->start = i;
        for (int k = 0; k < d->n_numbers; k++)
            d->table[i * d->n_numbers + k] = read_number(&c);
        for (int k = 0; k < EX_RIG; k++)
            d->rig[i * EX_RIG + k] = read_number(&c);
    }
    if (!c.is_good || d->start < 0) {
        snprintf(why, EX_WHY, FILE_NAME " is damaged in its table of settings");
        return 0;
    }
    number_states(d);
    return 1;
}

static int hex(char c)
{
    if (c >= '0' && c <= '9')
        return c - '0';
    if (c >= 'a' && c <= 'f')
        return c - 'a' + 10;
    return c >= 'A' && c <= 'F' ? c - 'A' + 10 : -1;
}

/* file:///C:/a%20b, file:/a, file://host/a or a path; as importers write it. */
static void path_of(const char *folder, char *path)
{
    const char *from = folder;
    char *const begin = path;
    const int is_uri = strncmp(folder, "file:", 5) == 0;
    if (is_uri) {
        from += 5;
        if (from[0] == '/' && from[1] == '/') {
            from += 2;
            if (strncmp(from, "localhost/", 10) == 0)
                from += 9;
        }
        if (from[0] == '/' && from[1] != '\0' && from[2] == ':')
            from++; /* a drive of Windows */
    }
    while (*from) {
        if (is_uri && from[0] == '%' && hex(from[1]) >= 0 && hex(from[2]) >= 0) {
            *path++ = (char)(16 * hex(from[1]) + hex(from[2]));
            from += 3;
        } else {
            *path++ = *from++;
        }
    }
    while (path > begin && (path[-1] == '/' || path[-1] == '\\'))
        path--;
    strcpy(path, "/" FILE_NAME);
}

/* Importers give paths in UTF-8, which Windows does not take as they are. */
static FILE *open_file(const char *path)
{
#ifdef _WIN32
    wchar_t wide[2048];
    if (MultiByteToWideChar(CP_UTF8, MB_ERR_INVALID_CHARS, path, -1, wide, 2048) > 0)
        return _wfopen(wide, L"rb");
#endif
    return fopen(path, "rb");
}

char *ex_read_text(const char *folder)
{
    if (!folder || !*folder)
        return NULL;
    char *text = NULL, *path = malloc(strlen(folder) + sizeof FILE_NAME + 2);
    if (!path)
        return NULL;
    path_of(folder, path);
    FILE *file = open_file(path);
    free(path);
    if (!file)
        return NULL;
    long size = -1;
    if (fseek(file, 0, SEEK_END) == 0)
        size = ftell(file);
    rewind(file);
    if (size >= 0 && size < LONGEST_FILE && (text = malloc((size_t)size + 1)) != NULL)
        text[fread(text, 1, (size_t)size, file)] = '\0';
    fclose(file);
    return text;
}
