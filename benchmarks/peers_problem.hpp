// Copyright 2026 the dp_swing_ros authors
// SPDX-License-Identifier: Apache-2.0
// How C++ calls the functions of a problem that CasADi has written in C; see peers_cpp.py.

#pragma once

#include <Eigen/Core>

#include <initializer_list>
#include <vector>

using Eigen::VectorXd;
using Function = int (*)(const double **, double **, int *, double *, int);
using Work = int (*)(int *, int *, int *, int *);

// a function of (x, u, p), where p are the numbers of model and cost; its results are dense,
// matrices by columns
#define WRITTEN(name) \
    extern "C" int name(const double **, double **, int *, double *, int); \
    extern "C" int name##_work(int *, int *, int *, int *);

namespace {

// room for what such functions are called with
std::vector<const double *> arg;
std::vector<double *> res;
std::vector<int> iw;
std::vector<double> w;

void make_room(std::initializer_list<Work> functions)
{
    for (auto work : functions) {
        int sizes[4];
        work(&sizes[0], &sizes[1], &sizes[2], &sizes[3]);
        arg.resize(std::max<size_t>(arg.size(), sizes[0]));
        res.resize(std::max<size_t>(res.size(), sizes[1]));
        iw.resize(std::max<size_t>(iw.size(), sizes[2]));
        w.resize(std::max<size_t>(w.size(), sizes[3]));
    }
}

void call(Function f, const double *x, const double *u, const VectorXd &p,
          std::initializer_list<double *> results)
{
    arg[0] = x, arg[1] = u, arg[2] = p.data();
    std::copy(results.begin(), results.end(), res.begin());
    f(arg.data(), res.data(), iw.data(), w.data(), 0);
}

}  // namespace
