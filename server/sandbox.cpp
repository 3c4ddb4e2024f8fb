#include "server/sandbox.h"

#include <fcntl.h>
#include <linux/audit.h>
#include <linux/filter.h>
#include <linux/landlock.h>
#include <linux/seccomp.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cstddef>
#include <string>
#include <system_error>

namespace radbake::server {
namespace {

// Rights that newer kernels know than the headers do.
constexpr std::uint64_t kRefer = 1ULL << 13U;
constexpr std::uint64_t kTruncate = 1ULL << 14U;
constexpr std::uint64_t kRead =
    LANDLOCK_ACCESS_FS_EXECUTE | LANDLOCK_ACCESS_FS_READ_FILE | LANDLOCK_ACCESS_FS_READ_DIR;
constexpr std::uint64_t kFile =
    LANDLOCK_ACCESS_FS_EXECUTE | LANDLOCK_ACCESS_FS_READ_FILE | LANDLOCK_ACCESS_FS_WRITE_FILE | kTruncate;
constexpr std::uint64_t kFirst = LANDLOCK_ACCESS_FS_MAKE_SYM * 2 - 1;  // all rights of the first version

constexpr std::array<const char*, 9> kSystem = {"/usr", "/bin",  "/lib", "/lib64", "/sbin",
                                                "/etc", "/proc", "/sys", "/dev"};

int LandlockVersion() {
  return static_cast<int>(
      ::syscall(SYS_landlock_create_ruleset, nullptr, 0, LANDLOCK_CREATE_RULESET_VERSION));
}

std::uint64_t KnownRights(int version) {
  return kFirst | (version >= 2 ? kRefer : 0) | (version >= 3 ? kTruncate : 0);
}

// What is not there needs no rule.
void Allow(const Descriptor& ruleset, const std::filesystem::path& path, std::uint64_t rights) {
  const Descriptor place(::open(path.c_str(), O_PATH | O_CLOEXEC));
  if (!place.open()) {
    return;
  }
  landlock_path_beneath_attr rule{};
  rule.allowed_access = std::filesystem::is_directory(path) ? rights : rights & kFile;
  rule.parent_fd = place.get();
  if (::syscall(SYS_landlock_add_rule, ruleset.get(), LANDLOCK_RULE_PATH_BENEATH, &rule, 0U) != 0) {
    throw std::system_error(errno, std::generic_category(), "landlock: " + path.string());
  }
}

Descriptor MakeRuleset(const std::filesystem::path& program, const std::filesystem::path& folder) {
  const int version = LandlockVersion();
  if (version < 1) {
    return {};
  }
  landlock_ruleset_attr attributes{};
  attributes.handled_access_fs = KnownRights(version);
  Descriptor ruleset(
      static_cast<int>(::syscall(SYS_landlock_create_ruleset, &attributes, sizeof attributes, 0U)));
  if (!ruleset.open()) {
    throw std::system_error(errno, std::generic_category(), "landlock");
  }
  for (const char* path : kSystem) {
    Allow(ruleset, path, kRead);
  }
  Allow(ruleset, program, kRead);
  Allow(ruleset, "/dev/null", kFile & KnownRights(version));
  Allow(ruleset, folder, KnownRights(version));
  return ruleset;
}

#if defined(__x86_64__)
constexpr unsigned kMachine = AUDIT_ARCH_X86_64;
#elif defined(__aarch64__)
constexpr unsigned kMachine = AUDIT_ARCH_AARCH64;
#endif

// Calls that a bake has no use for, and a stranger's code much.
constexpr std::array kDenied = {
    SYS_socket,     SYS_socketpair,  SYS_ptrace,          SYS_process_vm_readv,  SYS_process_vm_writev,
    SYS_bpf,        SYS_keyctl,      SYS_add_key,         SYS_request_key,       SYS_unshare,
    SYS_setns,      SYS_mount,       SYS_umount2,         SYS_pivot_root,        SYS_chroot,
    SYS_kexec_load, SYS_swapon,      SYS_perf_event_open, SYS_userfaultfd,       SYS_io_uring_setup,
    SYS_reboot,     SYS_init_module, SYS_finit_module,    SYS_pidfd_send_signal, SYS_open_by_handle_at};

// LeakSanitizer stops the threads of its own process with it.
#if defined(RADBAKE_ADDRESS_SANITIZER)
constexpr bool kTraces = true;
#else
constexpr bool kTraces = false;
#endif

// Calls whose first argument is the process that they act upon: itself alone.
constexpr std::array kOnlyItself = {SYS_kill, SYS_tgkill, SYS_rt_sigqueueinfo, SYS_rt_tgsigqueueinfo};

bool FilterCalls() {
  constexpr auto kLoad = static_cast<unsigned short>(BPF_LD | BPF_W | BPF_ABS);
  constexpr auto kEqual = static_cast<unsigned short>(BPF_JMP | BPF_JEQ | BPF_K);
  constexpr auto kAtLeast = static_cast<unsigned short>(BPF_JMP | BPF_JGE | BPF_K);
  constexpr auto kReturn = static_cast<unsigned short>(BPF_RET | BPF_K);
  constexpr unsigned kOtherAbi = 0x40000000;  // x32
  std::array<sock_filter, 8 + 2 * kDenied.size() + 5 * kOnlyItself.size()> filter{};
  std::size_t size = 0;
  const auto add = [&](unsigned short code, unsigned value, unsigned char yes = 0, unsigned char no = 0) {
    filter[size++] = {code, yes, no, value};
  };
  constexpr unsigned kRefuse = SECCOMP_RET_ERRNO | EPERM;
  add(kLoad, offsetof(seccomp_data, arch));
  add(kEqual, kMachine, 1, 0);
  add(kReturn, SECCOMP_RET_KILL_PROCESS);
  add(kLoad, offsetof(seccomp_data, nr));
  add(kAtLeast, kOtherAbi, 0, 1);
  add(kReturn, kRefuse);
  for (const int call : kDenied) {
    if (kTraces && call == SYS_ptrace) {
      continue;
    }
    add(kEqual, static_cast<unsigned>(call), 0, 1);
    add(kReturn, kRefuse);
  }
  for (const int call : kOnlyItself) {
    // After the check the call's number is gone: it ends here.
    add(kEqual, static_cast<unsigned>(call), 0, 4);
    add(kLoad, offsetof(seccomp_data, args));
    add(kEqual, static_cast<unsigned>(::getpid()), 1, 0);
    add(kReturn, kRefuse);
    add(kReturn, SECCOMP_RET_ALLOW);
  }
  add(kReturn, SECCOMP_RET_ALLOW);
  const sock_fprog program{static_cast<unsigned short>(size), filter.data()};
  return ::prctl(PR_SET_SECCOMP, SECCOMP_MODE_FILTER, &program) == 0 || errno == EINVAL;
}

bool SetLimit(int resource, std::uint64_t soft, std::uint64_t hard) {
  const rlimit limit{soft, hard};
  return ::setrlimit(static_cast<__rlimit_resource>(resource), &limit) == 0;
}

}  // namespace

bool Sandbox::CanConfine() {
  return LandlockVersion() >= 1;
}

Sandbox::Sandbox(const ChildLimits& limits, const std::filesystem::path& program,
                 const std::filesystem::path& folder)
    : limits_(limits), ruleset_(limits.confined ? MakeRuleset(program, folder) : Descriptor()) {}

bool Sandbox::Limit() const {
  constexpr std::uint64_t kGrace = 5;  // seconds between SIGXCPU and SIGKILL
  const auto cpu = static_cast<std::uint64_t>(limits_.cpu_time.count());
  return SetLimit(RLIMIT_CORE, 0, 0) &&
         (limits_.memory == 0 || SetLimit(RLIMIT_DATA, limits_.memory, limits_.memory)) &&
         (limits_.file_size == 0 || SetLimit(RLIMIT_FSIZE, limits_.file_size, limits_.file_size)) &&
         (limits_.open_files == 0 || SetLimit(RLIMIT_NOFILE, limits_.open_files, limits_.open_files)) &&
         (cpu == 0 || SetLimit(RLIMIT_CPU, cpu, cpu + kGrace));
}

bool Sandbox::Enter() const {
  return Limit() && ::prctl(PR_SET_NO_NEW_PRIVS, 1, 0, 0, 0) == 0 &&
         (!ruleset_.open() || ::syscall(SYS_landlock_restrict_self, ruleset_.get(), 0U) == 0) &&
         FilterCalls();
}

}  // namespace radbake::server
