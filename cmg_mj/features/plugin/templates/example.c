/* The rig balances in a plain C program: no Python.
 *
 *     make example && ./example */
#include <mujoco/mujoco.h>
#include <stdio.h>

int main(void)
{
    char error[1000] = "";
    mj_loadPluginLibrary("./@LIBRARY@");
    mjModel *m = mj_loadXML("@NAME@.xml", NULL, error, sizeof error);
    if (!m) {
        fprintf(stderr, "%s\n", error);
        return 1;
    }
    mjData *d = mj_makeData(m);
    mj_resetDataKeyframe(m, d, mj_name2id(m, mjOBJ_KEY, "start"));
    const int tilt = m->sensor_adr[mj_name2id(m, mjOBJ_SENSOR, @TILT_IN_C@)];
    while (d->time < 15.0) {
        mj_step(m, d);
        if ((int)(d->time * 1000.0 + 0.5) % 1000 == 0) printf("%4.1f s: tilt %8.4f rad\n", d->time, d->sensordata[tilt]);
    }
    mj_deleteData(d);
    mj_deleteModel(m);
    return 0;
}
