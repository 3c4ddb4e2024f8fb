// Loaded before the C library into a radbaked that is tested (LD_PRELOAD): a disk and a clock as bad as the
// file says that the environment's RADBAKED_FAULT names. It holds "full", "read-only", or how many seconds
// the clock is off; no file: nothing is wrong. Files are those below the folder that RADBAKED_FAULT_FOLDER
// names.
#include <dlfcn.h>
#include <fcntl.h>
#include <sys/stat.h>
#include <sys/statvfs.h>
#include <sys/syscall.h>
#include <sys/time.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <climits>
#include <cstdarg>
#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <string>
#include <string_view>

namespace {

template <typename Function>
Function* Next(const char* name) {
  return reinterpret_cast<Function*>(::dlsym(RTLD_NEXT, name));
}

// Past the functions below.
std::string Fault() {
  const char* const name = std::getenv("RADBAKED_FAULT");
  const auto file =
      name == nullptr ? -1 : static_cast<int>(::syscall(SYS_openat, AT_FDCWD, name, O_RDONLY | O_CLOEXEC));
  if (file < 0) {
    return "";
  }
  std::array<char, 64> text{};
  const ssize_t count = ::read(file, text.data(), text.size());
  ::close(file);
  return {text.data(), static_cast<std::size_t>(count > 0 ? count : 0)};
}

bool Below(std::string_view path) {
  const char* const folder = std::getenv("RADBAKED_FAULT_FOLDER");
  return folder != nullptr && path.starts_with(folder);
}

std::string Absolute(const char* path) {
  if (*path == '/') {
    return path;
  }
  std::array<char, PATH_MAX> here{};
  return ::getcwd(here.data(), here.size()) == nullptr ? path : std::string(here.data()) + "/" + path;
}

bool IsBelow(int file) {
  std::array<char, PATH_MAX> path{};
  const std::string link = "/proc/self/fd/" + std::to_string(file);
  const ssize_t size = ::readlink(link.c_str(), path.data(), path.size());
  return size > 0 && Below({path.data(), static_cast<std::size_t>(size)});
}

// The error of a change in the folder; 0: none.
int ErrorOfChange() {
  const int before = errno;
  const std::string fault = Fault();
  errno = before;
  return fault == "full" ? ENOSPC : fault == "read-only" ? EROFS : 0;
}

bool Refused(int file) {
  const int error = ErrorOfChange();
  if (error == 0 || !IsBelow(file)) {
    return false;
  }
  errno = error;
  return true;
}

// `frees`: it takes no room.
bool Refused(const char* path, bool frees = false) {
  const int error = ErrorOfChange();
  if (error == 0 || (frees && error == ENOSPC) || !Below(Absolute(path))) {
    return false;
  }
  errno = error;
  return true;
}

bool OpenRefused(const char* path, int flags) {
  struct stat status{};
  const bool makes = (flags & O_CREAT) != 0 && ::stat(path, &status) != 0;
  const bool writes = (flags & O_ACCMODE) != O_RDONLY;
  return (makes && Refused(path)) || (writes && Refused(path, true));
}

timespec Shifted(timespec time) {
  time.tv_sec += std::atol(Fault().c_str());
  return time;
}

}  // namespace

extern "C" {

ssize_t write(int file, const void* bytes, size_t size) {
  return Refused(file) ? -1 : Next<decltype(write)>("write")(file, bytes, size);
}
ssize_t pwrite64(int file, const void* bytes, size_t size, off64_t offset) {
  return Refused(file) ? -1 : Next<decltype(pwrite64)>("pwrite64")(file, bytes, size, offset);
}
ssize_t pwrite(int file, const void* bytes, size_t size, off_t offset) {
  return pwrite64(file, bytes, size, offset);
}
int open(const char* path, int flags, ...) {
  va_list more;
  va_start(more, flags);
  const auto mode = va_arg(more, mode_t);
  va_end(more);
  return OpenRefused(path, flags) ? -1 : static_cast<int>(::syscall(SYS_openat, AT_FDCWD, path, flags, mode));
}
int open64(const char* path, int flags, ...) {
  va_list more;
  va_start(more, flags);
  const auto mode = va_arg(more, mode_t);
  va_end(more);
  return open(path, flags, mode);
}
int mkdir(const char* path, mode_t mode) {
  return Refused(path) ? -1 : Next<decltype(mkdir)>("mkdir")(path, mode);
}
int rename(const char* from, const char* to) {
  return Refused(to, true) ? -1 : Next<decltype(rename)>("rename")(from, to);
}
int access(const char* path, int mode) {
  return (mode & W_OK) != 0 && Refused(path, true) ? -1 : Next<decltype(access)>("access")(path, mode);
}
int statvfs(const char* path, struct statvfs* space) {
  const int result = Next<int(const char*, struct statvfs*)>("statvfs")(path, space);
  if (result == 0 && Fault() == "full" && Below(Absolute(path))) {
    space->f_bavail = 0;
  }
  return result;
}

int clock_gettime(clockid_t clock, timespec* time) {
  const auto result = static_cast<int>(::syscall(SYS_clock_gettime, clock, time));
  if (result == 0 && clock == CLOCK_REALTIME) {
    *time = Shifted(*time);
  }
  return result;
}
int gettimeofday(timeval* time, void*) {
  timespec now{};
  clock_gettime(CLOCK_REALTIME, &now);
  *time = {now.tv_sec, now.tv_nsec / 1000};
  return 0;
}
time_t time(time_t* result) {
  timespec now{};
  clock_gettime(CLOCK_REALTIME, &now);
  if (result != nullptr) {
    *result = now.tv_sec;
  }
  return now.tv_sec;
}

}  // extern "C"
