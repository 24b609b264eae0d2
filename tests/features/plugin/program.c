/* A program without Python: program LIBRARY MODEL STEPS CYCLES. It prints qpos after each step; then, on standard
 * error, by how many bytes what is allocated grows from the second tenth of the cycles of making and deleting on. */
#include <malloc.h>
#include <mujoco/mujoco.h>
#include <stdio.h>
#include <stdlib.h>

static long allocated(void)
{
    const struct mallinfo2 heap = mallinfo2();
    return (long)(heap.uordblks + heap.hblkhd);
}

int main(int n, char **arguments)
{
    char error[1000] = "";
    long before = 0;
    if (n != 5) return 2;
    mj_loadPluginLibrary(arguments[1]);
    mjModel *m = mj_loadXML(arguments[2], NULL, error, sizeof error);
    if (!m) {
        fprintf(stderr, "%s\n", error);
        return 1;
    }
    mjData *d = mj_makeData(m);
    mj_resetDataKeyframe(m, d, mj_name2id(m, mjOBJ_KEY, "start"));
    for (long step = atol(arguments[3]); step > 0; --step) {
        mj_step(m, d);
        for (int i = 0; i < m->nq; ++i) printf("%a ", d->qpos[i]);
        putchar('\n');
    }
    const long cycles = atol(arguments[4]);
    for (long cycle = 0; cycle < cycles; ++cycle) {
        if (cycle == cycles / 10) before = allocated();
        mjData *other = mj_copyData(NULL, m, d);
        mj_step(m, other);
        mj_deleteData(other);
        other = mj_makeData(m);
        mj_step(m, other);
        mj_deleteData(other);
    }
    fprintf(stderr, "%ld\n", cycles ? allocated() - before : 0);
    mj_deleteData(d);
    mj_deleteModel(m);
    return 0;
}
