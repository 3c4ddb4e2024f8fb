/// The benchmark program: what it is made of, and how a benchmark says that its own answer is wrong.
#pragma once

#include <benchmark/benchmark.h>

#include <string>

#include "solver/scene/patches.h"

namespace radbake::bench {

/// `Bake`: whole bakes, each in a process of its own. Must run first: see there.
void RegisterBakes();
/// `Basis`: what the order of the basis is worth.
void RegisterBases();
/// `Links`: links against elements at a fixed F_max.
void RegisterLinks();
/// `Oracle`: what the adaptive oracle's terms are worth.
void RegisterOracles();
/// `Transport`: form factors, rays and shafts one by one.
void RegisterTransport();

/// Ends the benchmark as failed; the program's exit code is then 1.
void Fail(benchmark::State& state, const std::string& why);

/// Has Fail() been called at all?
bool AnyFailed();

/// The patches of one of scenes/.
Patches LoadPatches(const std::string& scene);

}  // namespace radbake::bench
