// Copyright 2026 the dp_swing_ros authors
// SPDX-License-Identifier: Apache-2.0
// The problem for crocoddyl, and for mim-solvers, of functions that CasADi has written; see
// peers_crocoddyl.py.

#include "peers_problem.hpp"

#include <crocoddyl/core/action-base.hpp>
#include <crocoddyl/core/optctrl/shooting.hpp>
#include <crocoddyl/core/solvers/box-ddp.hpp>
#include <crocoddyl/core/solvers/box-fddp.hpp>
#include <crocoddyl/core/states/euclidean.hpp>
#include <mim_solvers/csqp.hpp>
#include <mim_solvers/sqp.hpp>

using namespace crocoddyl;
using Action = ActionModelAbstractTpl<double>;
using DataPointer = std::shared_ptr<ActionDataAbstractTpl<double>>;
using State = StateVectorTpl<double>;
using ConstVectorRef = Eigen::Ref<const VectorXd>;

WRITTEN(pendulum_running) WRITTEN(pendulum_running_diff)
WRITTEN(pendulum_terminal) WRITTEN(pendulum_terminal_diff)

namespace {

// An action of the parameters p; of no other type of numbers is there any.
struct Node : Action {
    VectorXd p;
    Node(std::shared_ptr<State> state, const VectorXd &p, int constraints)
        : Action(state, 1, 0, constraints), p(p) {}
    std::shared_ptr<ActionModelBase> cloneAsDouble() const override { return nullptr; }
    std::shared_ptr<ActionModelBase> cloneAsFloat() const override { return nullptr; }
};

// A step; its bounds are limits, and where it is constrained a constraint as well.
struct Running : Node {
    bool constrained;
    Running(std::shared_ptr<State> state, const VectorXd &p, double low, double high,
            bool constrained)
        : Node(state, p, constrained), constrained(constrained)
    {
        const auto lowest = VectorXd::Constant(1, low), highest = VectorXd::Constant(1, high);
        if (constrained) {
            set_g_lb(lowest);
            set_g_ub(highest);
        }
        set_u_lb(lowest);
        set_u_ub(highest);
    }
    void calc(const DataPointer &data, const ConstVectorRef &x, const ConstVectorRef &u) override
    {
        call(pendulum_running, x.data(), u.data(), p, {data->xnext.data(), &data->cost});
        if (constrained)
            data->g = u;
    }
    void calcDiff(const DataPointer &data, const ConstVectorRef &x,
                  const ConstVectorRef &u) override
    {
        call(pendulum_running_diff, x.data(), u.data(), p,
             {data->Fx.data(), data->Fu.data(), data->Lx.data(), data->Lu.data(),
              data->Lxx.data(), data->Lxu.data(), data->Luu.data()});
    }
    DataPointer createData() override
    {
        auto data = Action::createData();
        data->Gu.setOnes();   // of the force by the force
        return data;
    }
};

struct Terminal : Node {
    Terminal(std::shared_ptr<State> state, const VectorXd &p) : Node(state, p, 0) {}
    void calc(const DataPointer &data, const ConstVectorRef &x) override
    {
        call(pendulum_terminal, x.data(), nullptr, p, {&data->cost});
    }
    void calcDiff(const DataPointer &data, const ConstVectorRef &x) override
    {
        call(pendulum_terminal_diff, x.data(), nullptr, p, {data->Lx.data(), data->Lxx.data()});
    }
    void calc(const DataPointer &data, const ConstVectorRef &x, const ConstVectorRef &) override
    {
        calc(data, x);
    }
    void calcDiff(const DataPointer &data, const ConstVectorRef &x,
                  const ConstVectorRef &) override
    {
        calcDiff(data, x);
    }
};

enum Kind { DDP, FDDP, BOX_DDP, BOX_FDDP, SQP, CSQP };

using Problem = std::shared_ptr<ShootingProblemTpl<double>>;

template <typename Theirs>
std::unique_ptr<SolverAbstract> of_crocoddyl(const Problem &problem, double tolerance)
{
    auto solver = std::make_unique<Theirs>(problem);
    solver->set_th_stop(tolerance);
    return solver;
}

std::unique_ptr<SolverAbstract> sqp(const Problem &problem, double tolerance)
{
    auto solver = std::make_unique<mim_solvers::SolverSQP>(problem);
    solver->set_termination_tolerance(tolerance);
    return solver;
}

std::unique_ptr<SolverAbstract> csqp(const Problem &problem, double tolerance)
{
    auto solver = std::make_unique<mim_solvers::SolverCSQP>(problem);
    solver->set_termination_tolerance(tolerance);
    solver->set_rho_update_interval(5);   // it looks whether it has converged as often
    return solver;
}

std::unique_ptr<SolverAbstract> solver_of(Kind kind, const Problem &problem, double tolerance)
{
    switch (kind) {
        case DDP: return of_crocoddyl<SolverDDP>(problem, tolerance);
        case FDDP: return of_crocoddyl<SolverFDDP>(problem, tolerance);
        case BOX_DDP: return of_crocoddyl<SolverBoxDDP>(problem, tolerance);
        case BOX_FDDP: return of_crocoddyl<SolverBoxFDDP>(problem, tolerance);
        case SQP: return sqp(problem, tolerance);
        default: return csqp(problem, tolerance);
    }
}

struct Solver {
    Problem problem;
    std::unique_ptr<SolverAbstract> solver;
    std::vector<VectorXd> X, U;
    void read(const double *X, const double *U)
    {
        const auto n = this->X[0].size();
        for (size_t t = 0; t < this->X.size(); t++)
            this->X[t] = Eigen::Map<const VectorXd>(X + t * n, n);
        for (size_t t = 0; t < this->U.size(); t++)
            this->U[t][0] = U[t];
        problem->set_x0(this->X[0]);
    }
};

}  // namespace

extern "C" {

// Make a solver of a kind over N steps, from states of n numbers, of the parameters given
// (count,), within low <= u <= high; with a tolerance.
void *create(int N, int n, const double *given, int count, double low, double high,
             double tolerance, int kind)
{
    make_room({pendulum_running_work, pendulum_running_diff_work, pendulum_terminal_work,
               pendulum_terminal_diff_work});
    const VectorXd p = Eigen::Map<const VectorXd>(given, count);
    const auto state = std::make_shared<State>(n);
    const std::vector<std::shared_ptr<Action>> steps(
        N, std::make_shared<Running>(state, p, low, high, kind == CSQP));
    const auto problem = std::make_shared<ShootingProblemTpl<double>>(
        VectorXd::Zero(n), steps, std::make_shared<Terminal>(state, p));
    problem->set_nthreads(1);   // more are slower, for steps this small
    return new Solver{problem, solver_of(static_cast<Kind>(kind), problem, tolerance),
                      std::vector<VectorXd>(N + 1, VectorXd(n)),
                      std::vector<VectorXd>(N, VectorXd(1))};
}

// Replace a trajectory, X (N + 1, n) and U (N,), by what so many iterations at most make of it,
// and write what it costs. Return the number of iterations, or -1 where the solver gives up.
int solve(void *of, int iterations, double *X, double *U, double *cost)
{
    auto &[problem, solver, xs, us] = *static_cast<Solver *>(of);
    const auto n = xs[0].size();
    static_cast<Solver *>(of)->read(X, U);
    if (auto *csqp = dynamic_cast<mim_solvers::SolverCSQP *>(solver.get()))
        for (auto &y : csqp->y_)   // which it else has of another solve
            y.setZero();
    try {
        solver->solve(xs, us, iterations, true);
    } catch (const std::exception &) {   // as where numbers overflow
        return -1;
    }
    for (size_t t = 0; t < xs.size(); t++)
        Eigen::Map<VectorXd>(X + t * n, n) = solver->get_xs()[t];
    for (size_t t = 0; t < us.size(); t++)
        U[t] = solver->get_us()[t][0];
    *cost = solver->get_cost();
    return static_cast<int>(solver->get_iter());
}

// Evaluate step, cost and all derivatives along a trajectory, as an iteration does.
void evaluate(void *of, const double *X, const double *U)
{
    auto &made = *static_cast<Solver *>(of);
    made.read(X, U);
    made.problem->calc(made.X, made.U);
    made.problem->calcDiff(made.X, made.U);
}

void destroy(void *solver) { delete static_cast<Solver *>(solver); }

}
