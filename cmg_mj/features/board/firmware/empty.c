/* A controller that does nothing. An image with it in place of another tells what that one occupies. */
#include "its.h"

void ITS(_init)(ITS(_state) *state, real y1, real y2, real acceleration)
{
    (void)state, (void)y1, (void)y2, (void)acceleration;
}

void ITS(_step)(ITS(_state) *state, real y1, real y2, real acceleration, real u, real estimate[ESTIMATES])
{
    (void)state, (void)y1, (void)y2, (void)acceleration, (void)u, (void)estimate;
}

void ITS(_start)(ITS(_controller) *controller)
{
    (void)controller;
}

ITS(_status) ITS(_update)(ITS(_controller) *controller, const real accelerations[4], const real encoders[ENCODERS],
                          real estimate[ESTIMATES], real *u)
{
    (void)controller, (void)accelerations, (void)encoders, (void)estimate, (void)u;
    return (ITS(_status))0;
}
