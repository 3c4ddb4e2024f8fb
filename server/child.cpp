#include "server/child.h"

#include <fcntl.h>
#include <poll.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/syscall.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <chrono>
#include <csignal>
#include <system_error>
#include <tuple>
#include <utility>

namespace radbake::server {
namespace {

using Clock = std::chrono::steady_clock;

constexpr std::chrono::milliseconds kGrace = std::chrono::seconds(2);
constexpr std::size_t kLongestOutputLine = 65536;
constexpr std::size_t kLongestError = 2000;
constexpr std::size_t kLongestLog = 4000;
constexpr std::size_t kPipeReadSize = 16384;
constexpr int kPipeReads = 64;  // empties a full pipe, and ends where somebody goes on filling it

[[noreturn]] void FailFor(const char* what) {
  throw std::system_error(errno, std::generic_category(), what);
}

std::pair<Descriptor, Descriptor> Pipe() {
  std::array<int, 2> ends{};
  if (::pipe2(ends.data(), O_CLOEXEC) != 0) {
    FailFor("pipe2");
  }
  return {Descriptor(ends[0]), Descriptor(ends[1])};
}

// Everything that the child needs is made before fork(): after it, only async-signal-safe calls are allowed.
struct Launch {
  const char* program;
  char* const* arguments;
  char* const* environment;
  const char* folder;
  pid_t parent;
  int input;
  int output;
  int error;
  unsigned highest_descriptor;
  const Sandbox* sandbox;
};

[[noreturn]] void BecomeProgram(const Launch& launch) {
  // The parent may have died before prctl() took effect.
  if (::prctl(PR_SET_PDEATHSIG, SIGKILL) != 0 || ::getppid() != launch.parent) {
    ::_exit(127);
  }
  sigset_t none;
  ::sigemptyset(&none);
  ::signal(SIGPIPE, SIG_DFL);
  ::sigprocmask(SIG_SETMASK, &none, nullptr);
  if (::dup2(launch.input, 0) < 0 || ::dup2(launch.output, 1) < 0 || ::dup2(launch.error, 2) < 0) {
    ::_exit(127);
  }
  const bool confined = launch.sandbox->Enter();
  if (::syscall(SYS_close_range, 3U, ~0U, 0U) != 0) {
    for (unsigned descriptor = 3; descriptor < launch.highest_descriptor; ++descriptor) {
      ::close(static_cast<int>(descriptor));
    }
  }
  if (confined && ::chdir(launch.folder) == 0) {
    ::execve(launch.program, launch.arguments, launch.environment);
  }
  constexpr std::string_view kMessage = "the program could not be started\n";
  static_cast<void>(!::write(2, kMessage.data(), kMessage.size()));
  ::_exit(127);
}

// Bytes in, whole lines out.
class Lines {
 public:
  explicit Lines(std::function<void(std::string_view)> take) : take_(std::move(take)) {}

  void Append(std::string_view bytes) {
    while (!bytes.empty()) {
      const std::size_t end = bytes.find('\n');
      const std::string_view piece = bytes.substr(0, end);
      too_long_ = too_long_ || line_.size() + piece.size() > kLongestOutputLine;
      if (!too_long_) {
        line_ += piece;
      }
      if (end == std::string_view::npos) {
        return;
      }
      End();
      bytes.remove_prefix(end + 1);
    }
  }

  void End() {
    if (!line_.empty() && !too_long_) {
      take_(line_);
    }
    line_.clear();
    too_long_ = false;
  }

 private:
  std::function<void(std::string_view)> take_;
  std::string line_;
  bool too_long_ = false;
};

// Whole lines, the last ones that there is room for.
void AppendToLog(const std::string& line, std::string& log) {
  log += line + "\n";
  while (log.size() > kLongestLog) {
    log.erase(0, log.find('\n') + 1);
  }
}

// Reads once from a pipe that does not block. False when there is nothing more.
bool Drain(const Descriptor& pipe, Lines& lines) {
  std::array<char, kPipeReadSize> buffer{};
  const ssize_t count = ::read(pipe.get(), buffer.data(), buffer.size());
  if (count > 0) {
    lines.Append({buffer.data(), static_cast<std::size_t>(count)});
  }
  return count > 0;
}

// A started child. It does not outlive this object.
class Process {
 public:
  explicit Process(pid_t pid) : pid_(pid), handle_(static_cast<int>(::syscall(SYS_pidfd_open, pid, 0))) {
    if (!handle_.open()) {
      const int error = errno;
      Kill(SIGKILL);
      Reap();
      errno = error;
      FailFor("pidfd_open");
    }
  }
  Process(Process&&) = delete;
  ~Process() {
    if (!reaped_) {
      Kill(SIGKILL);
      Reap();
    }
  }

  int descriptor() const { return handle_.get(); }  // readable when it has ended
  // It is not reaped yet: its number is still its own.
  void Kill(int signal) const { ::kill(pid_, signal); }

  int Reap() {
    int status = 0;
    while (::waitpid(pid_, &status, 0) < 0 && errno == EINTR) {
    }
    reaped_ = true;
    return status;
  }

 private:
  pid_t pid_;
  bool reaped_ = false;
  Descriptor handle_;
};

// SIGTERM when asked to stop or when the time is up, SIGKILL when that has not helped.
class Stopper {
 public:
  Stopper(const StopSignal& stop, std::chrono::seconds time)
      : stop_(&stop), deadline_(time.count() > 0 ? Clock::now() + time : Clock::time_point::max()) {}

  bool late() const { return late_; }

  int descriptor() const { return terminated_ ? -1 : stop_->descriptor(); }
  int timeout() const {
    if (killed_ || deadline_ == Clock::time_point::max()) {
      return -1;
    }
    constexpr std::chrono::milliseconds::rep kLongest = 60'000;
    const auto left = std::chrono::ceil<std::chrono::milliseconds>(deadline_ - Clock::now());
    return static_cast<int>(std::clamp<std::chrono::milliseconds::rep>(left.count(), 0, kLongest));
  }
  void Act(const Process& process) {
    const bool due = Clock::now() >= deadline_;
    if (!terminated_ && (due || stop_->raised())) {
      late_ = due;
      terminated_ = true;
      deadline_ = Clock::now() + kGrace;
      process.Kill(SIGTERM);
    } else if (terminated_ && !killed_ && due) {
      killed_ = true;
      process.Kill(SIGKILL);
    }
  }

 private:
  const StopSignal* stop_;
  bool terminated_ = false;
  bool killed_ = false;
  bool late_ = false;
  Clock::time_point deadline_;  // of what comes next
};

}  // namespace

ChildEnd RunChild(const ChildCommand& command, const std::function<void(std::string_view)>& on_line,
                  const StopSignal& stop) {
  std::vector<std::string> words = {command.program.string()};
  words.insert(words.end(), command.arguments.begin(), command.arguments.end());
  std::vector<char*> arguments;
  arguments.reserve(words.size() + 1);
  for (std::string& word : words) {
    arguments.push_back(word.data());
  }
  arguments.push_back(nullptr);
  std::vector<char*> environment;
  for (char** variable = environ; *variable != nullptr; ++variable) {
    if (!std::string_view(*variable).starts_with("PG")) {
      environment.push_back(*variable);
    }
  }
  environment.push_back(nullptr);

  const Descriptor input(::open("/dev/null", O_RDONLY | O_CLOEXEC));
  if (!input.open()) {
    FailFor("cannot open /dev/null");
  }
  auto [output, output_end] = Pipe();
  auto [error, error_end] = Pipe();
  const Sandbox sandbox(command.limits, command.program, command.folder);
  rlimit limit{};
  ::getrlimit(RLIMIT_NOFILE, &limit);
  const Launch launch = {command.program.c_str(),
                         arguments.data(),
                         environment.data(),
                         command.folder.c_str(),
                         ::getpid(),
                         input.get(),
                         output_end.get(),
                         error_end.get(),
                         static_cast<unsigned>(std::min<rlim_t>(limit.rlim_cur, 65536)),
                         &sandbox};
  const pid_t pid = ::fork();
  if (pid < 0) {
    FailFor("fork");
  }
  if (pid == 0) {
    BecomeProgram(launch);
  }
  Process process(pid);
  output_end.Close();
  error_end.Close();
  // Some descendant may hold the pipes open beyond the child's end: what is in them then is read, no more.
  ::fcntl(output.get(), F_SETFL, O_NONBLOCK);
  ::fcntl(error.get(), F_SETFL, O_NONBLOCK);

  ChildEnd end;
  Lines output_lines(on_line);
  Lines error_lines([&](std::string_view line) {
    end.error = line.substr(0, kLongestError);
    AppendToLog(end.error, end.log);
  });
  Stopper stopper(stop, command.limits.time);
  for (bool ended = false; !ended;) {
    std::array<pollfd, 4> events = {{{output.get(), POLLIN, 0},
                                     {error.get(), POLLIN, 0},
                                     {process.descriptor(), POLLIN, 0},
                                     {stopper.descriptor(), POLLIN, 0}}};
    if (::poll(events.data(), events.size(), stopper.timeout()) < 0) {
      continue;  // EINTR
    }
    ended = events[2].revents != 0;
    for (const auto& [pipe, lines, event] :
         {std::tuple(&output, &output_lines, &events[0]), std::tuple(&error, &error_lines, &events[1])}) {
      if (event->revents != 0 && !Drain(*pipe, *lines)) {
        pipe->Close();
      }
    }
    stopper.Act(process);
  }
  const int status = process.Reap();
  for (const auto& [pipe, lines] : {std::pair(&output, &output_lines), std::pair(&error, &error_lines)}) {
    for (int i = 0; i < kPipeReads && pipe->open() && Drain(*pipe, *lines); ++i) {
    }
    lines->End();
  }
  end.exit_code = WIFEXITED(status) ? WEXITSTATUS(status) : -1;
  end.late = stopper.late();
  end.signal = WIFSIGNALED(status) ? WTERMSIG(status) : 0;
  return end;
}

}  // namespace radbake::server
