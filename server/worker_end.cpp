#include "server/worker_end.h"

#include <csignal>
#include <fstream>
#include <nlohmann/json.hpp>
#include <string_view>
#include <system_error>

namespace radbake::server {
namespace {

bool OutOfMemory(const ChildEnd& end) {
  return end.exit_code == kFailed && Reason(end).starts_with("out of memory");
}

}  // namespace

std::string Reason(const ChildEnd& end) {
  constexpr std::string_view kPrefix = "radbake: ";
  std::string_view text = end.error;
  if (text.starts_with(kPrefix)) {
    text.remove_prefix(kPrefix.size());
  }
  return std::string(text);
}

std::string HowItEnded(const ChildEnd& end) {
  const std::string how = end.signal != 0      ? "was killed by signal " + std::to_string(end.signal)
                          : end.exit_code >= 0 ? "ended with exit code " + std::to_string(end.exit_code)
                                               : "left no result";
  return end.error.empty() ? how : how + ": " + Reason(end);
}

std::string LimitHit(const ChildEnd& end, const ChildLimits& limits) {
  if (end.late) {
    return "the bake took longer than the " + std::to_string(limits.time.count()) +
           " seconds that it may take";
  }
  if (end.signal == SIGXCPU) {
    return "the bake took more than the " + std::to_string(limits.cpu_time.count()) +
           " seconds of processor time that it may take";
  }
  if (limits.memory > 0 && OutOfMemory(end)) {
    return "the bake needs more than the " + std::to_string(limits.memory) +
           " bytes of memory that it may take";
  }
  if (end.signal == SIGXFSZ) {
    return "the bake wrote more than the " + std::to_string(limits.file_size) + " bytes that a file may have";
  }
  return "";
}

std::optional<KillReason> Killed(const ChildEnd& end, bool stopped) {
  if (end.late) {
    return KillReason::kTime;
  }
  if (end.signal == SIGXCPU) {
    return KillReason::kCpuTime;
  }
  if (end.signal == SIGXFSZ) {
    return KillReason::kFileSize;
  }
  if (stopped) {
    return KillReason::kStopped;
  }
  if (OutOfMemory(end)) {
    return KillReason::kMemory;
  }
  return end.signal == 0 ? std::nullopt : std::optional(KillReason::kSignal);
}

std::uint64_t Rays(const std::filesystem::path& statistics) {
  std::ifstream file(statistics, std::ios::binary);
  const nlohmann::json told = nlohmann::json::parse(file, nullptr, false);
  const nlohmann::json::json_pointer count("/rays/count");
  return told.is_object() && told.contains(count) && told.at(count).is_number_unsigned()
             ? told.at(count).get<std::uint64_t>()
             : 0;
}

bool IsResult(const std::filesystem::path& path) {
  std::error_code ignored;
  return std::filesystem::symlink_status(path, ignored).type() == std::filesystem::file_type::regular &&
         std::filesystem::file_size(path, ignored) > 0;
}

}  // namespace radbake::server
