/* An order of elimination of little fill, by nested dissection (George 1973, doi:10.1137/0710032): a separator, which
   no cell crosses, comes last, and the two parts that it leaves are put in order likewise.

   A separator is a smallest set of nodes between the nodes at either end of a part, found as the largest flow of
   paths from cell to cell that share no node (inertial flow: Schild and Sommer 2015, doi:10.1007/978-3-319-20086-6_22;
   the flow by Dinic's algorithm). What lies at an end is told by numbers of cells from two nodes far apart, so that
   the order needs no coordinates. */

#define SMALL 10      /* nodes that are not parted further */
#define MANY 10000    /* nodes of a large part */
#define UNEVEN 2.0    /* weight of the parts' uneven sizes beside the separator's own */
#define BETWEEN (-1)  /* a node that separates */

/* Shares of the nodes at either end: with few the separator is small, with many the parts are even, and the paths of
   large parts, which have one, short. */
static const double ENDS[] = {0.1, 0.25, 0.4}, ENDS_OF_MANY[] = {0.33};

/* Nodes and cells of a part. Its vertices are node v as v, where a path goes in, and as nodes + v, where it goes out,
   and cell c as 2 nodes + c. */
typedef struct {
    int nodes, cells;
    int *cells_of, *cell, *nodes_of, *node;   /* node v has the cells cell[cells_of[v]], ..., a cell its nodes likewise */
    int *number, *side, *end;                 /* of nodes in the whole; 1 and 2 at the ends, 0 between; those of cells */
    int *from, *into;                         /* the cells of the path through a node, or -1 */
    int *level, *next, *queue, *path;         /* of the vertices */
    int *left, *right, *near, *order, *best, *half; /* of the nodes */
} part;

static part *make_part(int nodes, int cells, int entries) {
    size_t n = nodes, m = cells, all = 2 * n + m;
    part *p = calloc(1, sizeof *p);
    int *room = p ? malloc((11 * n + 2 * m + 2 + 2 * (size_t)entries + 4 * all) * sizeof(int)) : NULL;
    if (!room) return free(p), NULL;
    p->nodes = nodes, p->cells = cells, p->cells_of = room;
#define TAKE(name, before, count) p->name = p->before + (count)
    TAKE(cell, cells_of, n + 1), TAKE(nodes_of, cell, entries), TAKE(node, nodes_of, m + 1), TAKE(number, node, entries);
    TAKE(side, number, n), TAKE(end, side, n), TAKE(from, end, m), TAKE(into, from, n), TAKE(level, into, n);
    TAKE(next, level, all), TAKE(queue, next, all), TAKE(path, queue, all), TAKE(left, path, all);
    TAKE(right, left, n), TAKE(near, right, n), TAKE(order, near, n), TAKE(best, order, n), TAKE(half, best, n);
#undef TAKE
    p->cells_of[0] = 0;
    return p;
}

static void drop_part(part *p) {
    if (p) free(p->cells_of);
    free(p);
}

/* Nodes of the cells, from the cells of the nodes. */
static void list_nodes(part *p) {
    int entries = p->cells_of[p->nodes];
    memset(p->nodes_of, 0, (p->cells + 1) * sizeof(int));
    for (int e = 0; e < entries; e++) p->nodes_of[p->cell[e] + 1]++;
    for (int c = 0; c < p->cells; c++) p->nodes_of[c + 1] += p->nodes_of[c];
    memcpy(p->next, p->nodes_of, p->cells * sizeof(int));
    for (int v = 0; v < p->nodes; v++)
        for (int e = p->cells_of[v]; e < p->cells_of[v + 1]; e++) p->node[p->next[p->cell[e]]++] = v;
}

/* The nodes whose `best` is `which`, with the cells that join them. */
static part *child_of(const part *p, int which) {
    int n = 0, m = 0, entries = 0, *met = p->next;
    memset(met, 0, p->cells * sizeof(int));
    for (int v = 0; v < p->nodes; v++)
        if (p->best[v] == which) {
            n++;
            for (int e = p->cells_of[v]; e < p->cells_of[v + 1]; e++) met[p->cell[e]]++;
        }
    for (int c = 0; c < p->cells; c++) {
        int count = met[c];
        met[c] = count > 1 ? m++ : -1;
        if (count > 1) entries += count;
    }
    part *own = make_part(n, m, entries);
    if (!own) return NULL;
    for (int v = 0, i = 0, t = 0; v < p->nodes; v++) {
        if (p->best[v] != which) continue;
        for (int e = p->cells_of[v]; e < p->cells_of[v + 1]; e++)
            if (met[p->cell[e]] >= 0) own->cell[t++] = met[p->cell[e]];
        own->number[i++] = p->number[v], own->cells_of[i] = t;
    }
    list_nodes(own);
    return own;
}

/* How many arcs leave a vertex, and where the k-th leads, -1 if a path cannot go there. A node that has a path is
   entered only to turn that path back to where it came from, and from where it goes to on its other side, to lead
   that path elsewhere. */
static int arcs(const part *p, int u) {
    int n = p->nodes, v = u < n ? u : u - n;
    if (u >= 2 * n) return p->nodes_of[v - n + 1] - p->nodes_of[v - n];
    return u < n && p->from[v] >= 0 ? 1 : p->cells_of[v + 1] - p->cells_of[v];
}

static int arc(const part *p, int u, int k) {
    int n = p->nodes, v = u < n ? u : u - n;
    if (u < 2 * n) return 2 * n + (u < n && p->from[v] >= 0 ? p->from[v] : p->cell[p->cells_of[v] + k]);
    v = p->node[p->nodes_of[v - n] + k];
    return p->side[v] ? -1 : p->into[v] == u - 2 * n ? n + v : v;
}

/* Levels of the vertices, counted from the cells at one end on, until one at the other end is met; whether it is. */
static int reaches(part *p, int begin, int other) {
    int cells = 2 * p->nodes, all = cells + p->cells, head = 0, tail = 0, last = all;
    memset(p->level, -1, all * sizeof(int));
    for (int c = 0; c < p->cells; c++)
        if (p->end[c] == begin) p->level[cells + c] = 0, p->queue[tail++] = cells + c;
    while (head < tail) {
        int u = p->queue[head++], level = p->level[u];
        if (level >= last) break;
        if (u >= cells && p->end[u - cells] == other) {
            last = level;
            continue;
        }
        for (int k = 0, count = arcs(p, u); k < count; k++) {
            int v = arc(p, u, k);
            if (v >= 0 && p->level[v] < 0) p->level[v] = level + 1, p->queue[tail++] = v;
        }
    }
    return last < all;
}

/* Add the path found, of `length` arcs, to the flow: from its end, so that it still shows which nodes had one. */
static void add_path(part *p, int length) {
    int n = p->nodes;
    for (int k = length - 1; k >= 0; k--) {
        int a = p->path[k], b = p->path[k + 1];
        if (a < n && p->into[a] < 0)
            p->into[a] = b - 2 * n;
        else if (a >= 2 * n && b < n)
            p->from[b] = a - 2 * n;
        else if (a >= n && a < 2 * n)
            p->into[a - n] = b - 2 * n;
    }
}

/* Add a path from a cell at the first end to one at the second, level by level; whether there is one. */
static int augment(part *p, int cell) {
    int cells = 2 * p->nodes, depth = 0;
    p->path[0] = cells + cell;
    while (depth >= 0) {
        int u = p->path[depth], count = arcs(p, u), to = -1;
        if (u >= cells && p->end[u - cells] == 2) return add_path(p, depth), 1;
        while (to < 0 && p->next[u] < count) {
            to = arc(p, u, p->next[u]++);
            if (to >= 0 && p->level[to] != p->level[u] + 1) to = -1;
        }
        if (to >= 0)
            p->path[++depth] = to;
        else
            depth--;
    }
    return 0;
}

/* Enlarge the flow that is there to the largest between the ends; 0 where it is above `limit`, or a cell has nodes
   at both ends. */
static int separated(part *p, double limit) {
    int paths = 0;
    memset(p->end, 0, p->cells * sizeof(int));
    for (int c = 0; c < p->cells; c++) {
        for (int e = p->nodes_of[c]; e < p->nodes_of[c + 1]; e++) p->end[c] |= p->side[p->node[e]];
        if (p->end[c] == 3) return 0;
    }
    for (int v = 0; v < p->nodes; v++) {
        if (p->side[v]) p->from[v] = p->into[v] = -1;
        if (p->from[v] >= 0) paths += (p->end[p->from[v]] == 1) - (p->end[p->into[v]] == 1);
    }
    while (reaches(p, 1, 2)) {
        memset(p->next, 0, (2 * p->nodes + p->cells) * sizeof(int));
        for (int c = 0; c < p->cells; c++)
            while (p->end[c] == 1 && augment(p, c))
                if (++paths > limit) return 0;
    }
    return 1;
}

/* Numbers of cells from a node to all others; -1 where none lead. */
static void distances(part *p, int node, int *found) {
    memset(p->side, 0, p->nodes * sizeof(int));
    memset(p->end, 0, p->cells * sizeof(int));
    memset(p->from, -1, p->nodes * sizeof(int));
    memset(p->into, -1, p->nodes * sizeof(int));
    for (int e = p->cells_of[node]; e < p->cells_of[node + 1]; e++) p->end[p->cell[e]] = 1;
    reaches(p, 1, 2);
    for (int v = 0; v < p->nodes; v++) found[v] = p->level[v] < 0 ? -1 : p->level[v] / 2 + 1;
    found[node] = 0;
}

static int farthest(const int *distance, int count) {
    int most = 0;
    for (int i = 1; i < count; i++) if (distance[i] > distance[most]) most = i;
    return most;
}

/* Nodes in the order of how much nearer they are to `node` than to the one farthest from it. */
static void line_up(part *p, int node) {
    int n = p->nodes, *begin = p->queue;
    distances(p, node, p->left);
    int other = farthest(p->left, n), length = p->left[other];
    distances(p, other, p->right);
    memset(begin, 0, (2 * (size_t)length + 2) * sizeof(int));
    for (int v = 0; v < n; v++) {
        if (p->left[v] < p->near[v]) p->near[v] = p->left[v];
        if (p->right[v] < p->near[v]) p->near[v] = p->right[v];
        begin[p->left[v] - p->right[v] + length + 1]++;
    }
    for (int i = 0; i <= 2 * length; i++) begin[i + 1] += begin[i];
    for (int v = 0; v < n; v++) p->order[begin[p->left[v] - p->right[v] + length]++] = v;
}

/* The separator nearest to the end from which the flow was searched in vain, as the `half` of each node; it replaces
   the best one if it costs less. Returns the cost of the better. */
static double compare(part *p, int end, double cost) {
    int n = p->nodes, count[2] = {0, 0};
    for (int v = 0; v < n; v++) {
        int met = p->level[v] >= 0, near = p->level[n + v] >= 0 || (met && p->from[v] < 0);
        p->half[v] = p->side[v] ? p->side[v] == 2 : near ? end == 2 : met ? BETWEEN : end == 1;
        if (p->half[v] >= 0) count[p->half[v]]++;
    }
    double uneven = (double)(count[0] - count[1]) / n, own = n - count[0] - count[1];
    own *= 1.0 + UNEVEN * uneven * uneven;
    if (cost >= 0.0 && own >= cost) return cost;
    memcpy(p->best, p->half, n * sizeof(int));
    return own;
}

/* Find the best separator with the nodes in their present order; its cost if it is less. */
static double separate(part *p, double cost) {
    int n = p->nodes, rounds = n > MANY ? 1 : sizeof ENDS / sizeof *ENDS;
    const double *ends = n > MANY ? ENDS_OF_MANY : ENDS;
    memset(p->from, -1, n * sizeof(int));
    memset(p->into, -1, n * sizeof(int));
    for (int t = 0; t < rounds; t++) {
        int many = ends[t] * n < 1.0 ? 1 : (int)(ends[t] * n), *swap = p->from;
        memset(p->side, 0, n * sizeof(int));
        for (int i = 0; i < many; i++) p->side[p->order[i]] = 1, p->side[p->order[n - 1 - i]] = 2;
        if (!separated(p, cost < 0.0 ? n : cost)) break;
        cost = compare(p, 1, cost);
        p->from = p->into, p->into = swap; /* the paths backwards */
        reaches(p, 2, 1);
        cost = compare(p, 2, cost);
        p->into = p->from, p->from = swap;
    }
    return cost;
}

/* Part the nodes in two, by the best separator of some directions, each from the node farthest from those before,
   unless they hang together nowhere; 0 where there is none. */
static int parts(part *p, int directions) {
    int n = p->nodes, lonely = p->cells_of[1] == 0, apart = 0;
    double cost = -1.0;
    distances(p, 0, p->left);
    for (int v = 0; v < n; v++) {
        p->best[v] = lonely ? p->cells_of[v] < p->cells_of[v + 1] : p->left[v] < 0;
        apart += p->best[v];
        p->near[v] = n;
    }
    if (apart) return 1;
    for (int i = 0, node = farthest(p->left, n); i < directions; i++, node = farthest(p->near, n)) {
        line_up(p, node);
        cost = separate(p, cost);
    }
    return cost >= 0.0;
}

/* Put the nodes of a part, which is dropped, in an order of elimination; 0 where memory ends. */
static int dissect(part *p, int directions, int *order) {
    if (!p) return 0;
    int n = p->nodes, last = n;
    if (n <= SMALL || p->cells == 0 || !parts(p, directions)) {
        memcpy(order, p->number, n * sizeof(int));
        return drop_part(p), 1;
    }
    for (int v = n - 1; v >= 0; v--) if (p->best[v] == BETWEEN) order[--last] = p->number[v];
    part *first = child_of(p, 0), *second = child_of(p, 1);
    drop_part(p);
    int count = first ? first->nodes : 0, done = dissect(first, directions, order);
    if (!done) return drop_part(second), 0;
    return dissect(second, directions, order + count);
}

/* All nodes but the last, in E cells of n nodes, as a part; NULL where memory ends. */
static part *whole(int nodes, const int *given, int E, int n) {
    part *p = make_part(nodes, E, E * n);
    if (!p) return NULL;
    memset(p->cells_of, 0, (nodes + 1) * sizeof(int));
    for (int e = 0; e < E * n; e++) if (given[e] < nodes) p->cells_of[given[e] + 1]++;
    for (int v = 0; v < nodes; v++) p->cells_of[v + 1] += p->cells_of[v], p->number[v] = v;
    memcpy(p->level, p->cells_of, nodes * sizeof(int));
    for (int e = 0; e < E * n; e++) if (given[e] < nodes) p->cell[p->level[given[e]]++] = e / n;
    list_nodes(p);
    return p;
}
