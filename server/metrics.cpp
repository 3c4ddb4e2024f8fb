#include "server/metrics.h"

#include <sys/resource.h>
#include <unistd.h>

#include <array>
#include <charconv>
#include <fstream>
#include <utility>

namespace radbake::server {
namespace {

constexpr std::array<double, 12> kBounds = {0.1, 0.5, 1, 2.5, 5, 10, 30, 60, 300, 900, 3600, 14400};

constexpr std::array<KillReason, 6> kReasons = {KillReason::kTime,     KillReason::kCpuTime,
                                                KillReason::kFileSize, KillReason::kMemory,
                                                KillReason::kStopped,  KillReason::kSignal};

std::string Number(double value) {
  std::array<char, 32> text{};
  const auto [end, error] = std::to_chars(text.data(), text.data() + text.size(), value);
  return {text.data(), end};
}

void Head(const std::string& name, const char* type, const char* help, std::string& text) {
  text += "# HELP " + name + " " + help + "\n# TYPE " + name + " " + type + "\n";
}

void Single(const std::string& name, const char* type, const char* help, const std::string& value,
            std::string& text) {
  Head(name, type, help, text);
  text += name + " " + value + "\n";
}

// {name="value",…}; the values are our own words, which need no escape.
std::string Labels(std::initializer_list<std::pair<const char*, std::string_view>> labels) {
  std::string text = "{";
  for (const auto& [name, value] : labels) {
    text += text.size() > 1 ? "," : "";
    text += std::string(name) + "=\"" + std::string(value) + "\"";
  }
  return text + "}";
}

std::uint64_t ResidentBytes() {
  std::uint64_t all = 0;
  std::uint64_t resident = 0;
  std::ifstream("/proc/self/statm") >> all >> resident;
  return resident * static_cast<std::uint64_t>(::sysconf(_SC_PAGESIZE));
}

double ProcessorSeconds() {
  rusage usage{};
  ::getrusage(RUSAGE_SELF, &usage);
  const auto seconds = [](const timeval& time) {
    return static_cast<double>(time.tv_sec) + static_cast<double>(time.tv_usec) * 1e-6;
  };
  return seconds(usage.ru_utime) + seconds(usage.ru_stime);
}

}  // namespace

std::string_view ToString(KillReason reason) {
  switch (reason) {
    case KillReason::kTime:
      return "time";
    case KillReason::kCpuTime:
      return "cpu_time";
    case KillReason::kFileSize:
      return "file_size";
    case KillReason::kMemory:
      return "memory";
    case KillReason::kStopped:
      return "stopped";
    case KillReason::kSignal:
      return "signal";
  }
  return "";
}

void Metrics::Histogram::Add(Seconds value) {
  counts.resize(kBounds.size() + 1);
  std::size_t bucket = 0;
  while (bucket < kBounds.size() && value.count() > kBounds.at(bucket)) {
    ++bucket;
  }
  ++counts[bucket];
  sum += value.count();
}

void Metrics::Histogram::Write(const std::string& name, const char* help, std::string& text) const {
  Head(name, "histogram", help, text);
  std::uint64_t count = 0;
  for (std::size_t i = 0; i <= kBounds.size(); ++i) {
    count += counts.empty() ? 0 : counts[i];
    const std::string bound = i < kBounds.size() ? Number(kBounds.at(i)) : "+Inf";
    text += name + "_bucket" + Labels({{"le", bound}}) + " " + std::to_string(count) + "\n";
  }
  text += name + "_sum " + Number(sum) + "\n" + name + "_count " + std::to_string(count) + "\n";
}

void Metrics::CountRequest(std::string_view route, std::string_view method, int status) {
  const std::lock_guard lock(mutex_);
  ++requests_[{std::string(route), std::string(method), status}];
}

void Metrics::CountReceived(std::uint64_t bytes) {
  const std::lock_guard lock(mutex_);
  received_ += bytes;
}

void Metrics::CountSent(std::uint64_t bytes) {
  const std::lock_guard lock(mutex_);
  sent_ += bytes;
}

void Metrics::CountStart(Seconds queued) {
  const std::lock_guard lock(mutex_);
  queue_seconds_.Add(queued);
}

void Metrics::CountBake(std::string_view outcome, Seconds baked, std::uint64_t rays) {
  const std::lock_guard lock(mutex_);
  ++bakes_[std::string(outcome)];
  bake_seconds_.Add(baked);
  rays_ += rays;
}

void Metrics::CountKill(KillReason reason) {
  const std::lock_guard lock(mutex_);
  ++kills_[reason];
}

std::string Metrics::Text(const Gauges& gauges) const {
  const std::lock_guard lock(mutex_);
  std::string text;
  Head("radbaked_build_info", "gauge", "Which radbaked this is.", text);
  text += "radbaked_build_info" + Labels({{"version", RADBAKE_VERSION}}) + " 1\n";
  Single("radbaked_queue_up", "gauge", "Whether the queue can be read.", gauges.jobs.empty() ? "0" : "1",
         text);
  Head("radbaked_jobs", "gauge", "Jobs that are there, by state.", text);
  for (const auto& [status, count] : gauges.jobs) {
    text += "radbaked_jobs" + Labels({{"state", status}}) + " " + std::to_string(count) + "\n";
  }
  queue_seconds_.Write("radbaked_job_queue_seconds", "From a job's making to its first bake.", text);
  bake_seconds_.Write("radbaked_bake_seconds", "From the start of a bake's process to its end.", text);
  Head("radbaked_bakes_total", "counter", "Bakes that have ended, by how.", text);
  for (const auto& [outcome, count] : bakes_) {
    text += "radbaked_bakes_total" + Labels({{"outcome", outcome}}) + " " + std::to_string(count) + "\n";
  }
  Head("radbaked_children_killed_total", "counter", "Baking processes that were killed, by reason.", text);
  for (const KillReason reason : kReasons) {
    const auto found = kills_.find(reason);
    text += "radbaked_children_killed_total" + Labels({{"reason", ToString(reason)}}) + " " +
            std::to_string(found == kills_.end() ? 0 : found->second) + "\n";
  }
  Single("radbaked_rays_total", "counter", "Rays that finished bakes have traced.", std::to_string(rays_),
         text);
  Head("radbaked_http_requests_total", "counter", "Answered requests.", text);
  for (const auto& [key, count] : requests_) {
    const auto& [route, method, status] = key;
    text += "radbaked_http_requests_total" +
            Labels({{"route", route}, {"method", method}, {"status", std::to_string(status)}}) + " " +
            std::to_string(count) + "\n";
  }
  Single("radbaked_http_received_bytes_total", "counter", "Bytes of requests.", std::to_string(received_),
         text);
  Single("radbaked_http_sent_bytes_total", "counter", "Bytes of answers.", std::to_string(sent_), text);
  Single("radbaked_http_connections", "gauge", "Open connections.", std::to_string(gauges.connections), text);
  if (gauges.free_bytes) {
    Single("radbaked_disk_free_bytes", "gauge", "Left on the disk that holds the jobs.",
           std::to_string(*gauges.free_bytes), text);
  }
  Single("process_resident_memory_bytes", "gauge", "Memory of this process.", std::to_string(ResidentBytes()),
         text);
  Single("process_cpu_seconds_total", "counter", "Processor time of this process.",
         Number(ProcessorSeconds()), text);
  return text;
}

}  // namespace radbake::server
