/// What the end of a bake's child means.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>

#include "server/child.h"
#include "server/metrics.h"

namespace radbake::server {

/// The exit codes of `radbake bake` (DESIGN section 2).
inline constexpr int kBaked = 0;
inline constexpr int kFailed = 1;
inline constexpr int kBadInput = 2;

/// The last that it said, without the name of the program that said it.
std::string Reason(const ChildEnd& end);

/// In words that go after "the bake", with the reason.
std::string HowItEnded(const ChildEnd& end);

/// The limit that has ended the child, in a sentence; empty: none. Another attempt would end alike.
std::string LimitHit(const ChildEnd& end, const ChildLimits& limits);

/// Why the child did not end by itself; nothing: it did.
std::optional<KillReason> Killed(const ChildEnd& end, bool stopped);

/// Whether there is a file, and something in it. A child may leave anything in a result's place.
bool IsResult(const std::filesystem::path& path);

/// What the statistics of a finished bake say that it has traced; 0: nothing.
std::uint64_t Rays(const std::filesystem::path& statistics);

}  // namespace radbake::server
