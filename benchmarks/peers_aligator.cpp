// Copyright 2026 the dp_swing_ros authors
// SPDX-License-Identifier: Apache-2.0
// The problem for aligator, of functions that CasADi has written; see peers_aligator.py.

#include "peers_problem.hpp"

#include <aligator/core/cost-abstract.hpp>
#include <aligator/core/explicit-dynamics.hpp>
#include <aligator/core/traj-opt-problem.hpp>
#include <aligator/core/vector-space.hpp>
#include <aligator/modelling/constraints/box-constraint.hpp>
#include <aligator/modelling/state-error.hpp>
#include <aligator/solvers/proxddp/solver-proxddp.hpp>

using namespace aligator;
using aligator::context::ConstVectorRef;
using Space = VectorSpaceTpl<double, Eigen::Dynamic>;

WRITTEN(pendulum_step) WRITTEN(pendulum_step_jac)
WRITTEN(pendulum_running) WRITTEN(pendulum_running_jac) WRITTEN(pendulum_running_hess)
WRITTEN(pendulum_terminal) WRITTEN(pendulum_terminal_jac) WRITTEN(pendulum_terminal_hess)

namespace {

struct Step : ExplicitDynamicsModelTpl<double> {
    VectorXd p;
    Step(const Space &space, const VectorXd &p)
        : ExplicitDynamicsModelTpl<double>(space, 1), p(p) {}
    void forward(const ConstVectorRef &x, const ConstVectorRef &u, Data &data) const override
    {
        call(pendulum_step, x.data(), u.data(), p, {data.xnext_.data()});
    }
    void dForward(const ConstVectorRef &x, const ConstVectorRef &u, Data &data) const override
    {
        call(pendulum_step_jac, x.data(), u.data(), p, {data.jac_buffer_.data()});
    }
};

struct Cost : CostAbstractTpl<double> {
    VectorXd p;
    Function value, jac, hess;
    Cost(const Space &space, const VectorXd &p, Function value, Function jac, Function hess)
        : CostAbstractTpl<double>(space, 1), p(p), value(value), jac(jac), hess(hess) {}
    void evaluate(const ConstVectorRef &x, const ConstVectorRef &u, CostData &data) const override
    {
        call(value, x.data(), u.data(), p, {&data.value_});
    }
    void computeGradients(const ConstVectorRef &x, const ConstVectorRef &u,
                          CostData &data) const override
    {
        call(jac, x.data(), u.data(), p, {data.grad_.data()});
    }
    void computeHessians(const ConstVectorRef &x, const ConstVectorRef &u,
                         CostData &data) const override
    {
        call(hess, x.data(), u.data(), p, {data.hess_.data()});
    }
};

struct Solver {
    TrajOptProblemTpl<double> problem;
    SolverProxDDPTpl<double> solver;
    std::vector<VectorXd> X, U;
    std::vector<VectorXd> of_constraints, of_steps;   // first multipliers
};

}  // namespace

extern "C" {

// Make a solver over N steps, from states of n numbers, of the parameters given (count,), within
// low <= u <= high; with a tolerance and a first penalty.
void *create(int N, int n, const double *given, int count, double low, double high,
             double tolerance, double penalty)
{
    make_room({pendulum_step_work, pendulum_step_jac_work, pendulum_running_work,
               pendulum_running_jac_work, pendulum_running_hess_work, pendulum_terminal_work,
               pendulum_terminal_jac_work, pendulum_terminal_hess_work});
    const VectorXd p = Eigen::Map<const VectorXd>(given, count);
    const Space space(n);
    StageModelTpl<double> stage(
        Cost(space, p, pendulum_running, pendulum_running_jac, pendulum_running_hess),
        Step(space, p));
    stage.addConstraint(ControlErrorResidualTpl<double>(n, 1), BoxConstraintTpl<double>(
        VectorXd::Constant(1, low), VectorXd::Constant(1, high)));
    const std::vector<xyz::polymorphic<StageModelTpl<double>>> stages(N, stage);
    auto *made = new Solver{
        {VectorXd::Zero(n), stages,
         Cost(space, p, pendulum_terminal, pendulum_terminal_jac, pendulum_terminal_hess)},
        {tolerance, penalty, 1000, VerboseLevel::QUIET},
        std::vector<VectorXd>(N + 1, VectorXd(n)), std::vector<VectorXd>(N, VectorXd(1)), {}, {}};
    made->solver.setup(made->problem);
    made->of_constraints = made->solver.results_.vs;
    made->of_steps = made->solver.results_.lams;
    return made;
}

// Replace a trajectory, X (N + 1, n) and U (N,), by what so many iterations at most make of it,
// and write what it costs. Return the number of iterations, or -1 where aligator gives up.
int solve(void *of, int iterations, double *X, double *U, double *cost)
{
    auto &[problem, solver, xs, us, vs, lams] = *static_cast<Solver *>(of);
    const auto n = xs[0].size();
    for (size_t t = 0; t < xs.size(); t++)
        xs[t] = Eigen::Map<VectorXd>(X + t * n, n);
    for (size_t t = 0; t < us.size(); t++)
        us[t][0] = U[t];
    problem.setInitState(xs[0]);
    solver.max_iters = iterations;
    solver.preg_ = solver.reg_init;   // and nothing else of another solve
    solver.linesearch_.reset();
    try {
        solver.run(problem, xs, us, vs, lams);
    } catch (const std::exception &) {   // as where numbers overflow; which it is left with
        solver.setup(problem);
        return -1;
    }
    const auto &found = solver.results_;
    for (size_t t = 0; t < xs.size(); t++)
        Eigen::Map<VectorXd>(X + t * n, n) = found.xs[t];
    for (size_t t = 0; t < us.size(); t++)
        U[t] = found.us[t][0];
    *cost = found.traj_cost_;
    return static_cast<int>(found.num_iters);
}

void destroy(void *solver) { delete static_cast<Solver *>(solver); }

}
