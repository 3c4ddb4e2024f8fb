/// How much memory there is for this process and its children.
#pragma once

#include <cstdint>
#include <filesystem>

namespace radbake::server {

/// Bytes: the machine's, or what the control groups of this process (version 2) leave of them.
/// `root`: where /proc and /sys are.
std::uint64_t MemoryBytes(const std::filesystem::path& root = "/");

}  // namespace radbake::server
