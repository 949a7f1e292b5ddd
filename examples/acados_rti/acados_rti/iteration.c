// Copyright 2026 the dp_swing_ros authors
// SPDX-License-Identifier: Apache-2.0
// What Python calls of a solver that acados has written: through its ctypes interface, each number
// a call, an iteration would take twice as long.

#include <stdlib.h>

#include "acados_c/ocp_nlp_interface.h"
#include "acados_solver_pendulum.h"

// Make a solver over N steps, condensed to so many blocks; NULL where acados cannot.
void *create(int N, int blocks)
{
    pendulum_solver_capsule *solver = pendulum_acados_create_capsule();
    double *scaling = malloc(N * sizeof(double));   // acados weighs the cost of a step by its time
    if (!solver || !scaling)
        return NULL;
    for (int t = 0; t < N; t++)
        scaling[t] = 1.0;
    int failed = pendulum_acados_create_with_discretization(solver, N, scaling)
        || (blocks < N && pendulum_acados_update_qp_solver_cond_N(solver, blocks));
    free(scaling);
    return failed ? NULL : solver;
}

// Solve a problem over N steps of parameters p and low <= u <= high from now on.
void set_problem(void *of, int N, double *p, double low, double high)
{
    pendulum_solver_capsule *solver = of;
    for (int t = 0; t <= N; t++)
        pendulum_acados_update_params(solver, t, p, PENDULUM_NP);
    for (int t = 0; t < N; t++) {
        ocp_nlp_constraints_model_set(
            solver->nlp_config, solver->nlp_dims, solver->nlp_in, t, "lbu", &low);
        ocp_nlp_constraints_model_set(
            solver->nlp_config, solver->nlp_dims, solver->nlp_in, t, "ubu", &high);
    }
}

// Replace a trajectory, X (N + 1, PENDULUM_NX) and U (N,), by what an iteration makes of it;
// X[0] stays. Return acados's status.
int iterate(void *of, int N, double *X, double *U)
{
    pendulum_solver_capsule *solver = of;
    ocp_nlp_config *config = solver->nlp_config;
    ocp_nlp_dims *dims = solver->nlp_dims;
    ocp_nlp_constraints_model_set(config, dims, solver->nlp_in, 0, "lbx", X);
    ocp_nlp_constraints_model_set(config, dims, solver->nlp_in, 0, "ubx", X);
    for (int t = 0; t <= N; t++) {
        ocp_nlp_out_set(config, dims, solver->nlp_out, t, "x", X + t * PENDULUM_NX);
        if (t < N)
            ocp_nlp_out_set(config, dims, solver->nlp_out, t, "u", U + t);
    }
    int status = pendulum_acados_solve(solver);
    for (int t = 0; t <= N; t++) {
        ocp_nlp_out_get(config, dims, solver->nlp_out, t, "x", X + t * PENDULUM_NX);
        if (t < N)
            ocp_nlp_out_get(config, dims, solver->nlp_out, t, "u", U + t);
    }
    return status;
}

// Return the cost of the last trajectory, as acados counts it.
double cost(void *of)
{
    pendulum_solver_capsule *solver = of;
    double cost;
    ocp_nlp_eval_cost(solver->nlp_solver, solver->nlp_in, solver->nlp_out);
    ocp_nlp_get(solver->nlp_config, solver->nlp_solver, "cost_value", &cost);
    return cost;
}
