// Tells ThreadSanitizer how oneTBB orders its tasks. Debian's oneTBB is not built with ThreadSanitizer, which
// so sees none of the order that the scheduler makes and takes every hand-over of data between tasks for a
// race. Suppressions could only be blind to all that runs inside a parallel loop. Instead, this library
// stands before oneTBB's at run time, hands each call on, and adds the order that oneTBB promises: what
// happened before a task is spawned happens before it runs, and what a task did happens before the wait for
// it returns. Linked into every program of the `tsan` preset.
#include <dlfcn.h>
#include <oneapi/tbb/task_arena.h>
#include <sanitizer/tsan_interface.h>

#include <cstddef>
#include <cstdint>
#include <cstdlib>

namespace tbb::detail {
namespace {

/// oneTBB's own function of that (mangled) name.
template <typename Function>
Function* Original(const char* name) {
  void* function = dlsym(RTLD_NEXT, name);
  if (function == nullptr) {
    std::abort();
  }
  return reinterpret_cast<Function*>(function);
}

/// Runs a spawned task where oneTBB runs it, after what happened before the spawn.
class OrderedTask final : public d1::task {
 public:
  explicit OrderedTask(d1::task& task) : task_(task) { __tsan_release(this); }

  d1::task* execute(d1::execution_data& data) override {
    d1::task& task = Take();
    return task.execute(data);
  }
  d1::task* cancel(d1::execution_data& data) override {
    d1::task& task = Take();
    return task.cancel(data);
  }

 private:
  d1::task& Take() {
    __tsan_acquire(this);
    d1::task& task = task_;
    delete this;
    return task;
  }

  d1::task& task_;
};

/// Runs what task_arena::execute was given, on this thread or another one, between its call and its return.
class OrderedDelegate final : public d1::delegate_base {
 public:
  explicit OrderedDelegate(d1::delegate_base& delegate) : delegate_(delegate) { __tsan_release(&delegate_); }

  bool operator()() const override {
    __tsan_acquire(&delegate_);
    const bool result = delegate_();
    __tsan_release(&delegate_);
    return result;
  }

 private:
  d1::delegate_base& delegate_;
};

/// What was released at an address, in each task that a wait waits for, is acquired when the wait returns or
/// throws.
class AcquireAtEnd {
 public:
  explicit AcquireAtEnd(void* address) : address_(address) {}
  ~AcquireAtEnd() { __tsan_acquire(address_); }
  AcquireAtEnd(const AcquireAtEnd&) = delete;
  AcquireAtEnd& operator=(const AcquireAtEnd&) = delete;

 private:
  void* address_;
};

/// A wait_context's reference count, which every task that ends counts down (in its header, so that
/// ThreadSanitizer sees it), stands behind one 64-bit word.
void* Count(d1::wait_context& context) {
  static_assert(sizeof(d1::wait_context) == 2 * sizeof(std::uint64_t));
  return reinterpret_cast<std::uint64_t*>(&context) + 1;
}

}  // namespace

namespace r1 {

void spawn(d1::task& task, d1::task_group_context& context) {
  static auto* const original = Original<void(d1::task&, d1::task_group_context&)>(
      "_ZN3tbb6detail2r15spawnERNS0_2d14taskERNS2_18task_group_contextE");
  original(*new OrderedTask(task), context);
}

void spawn(d1::task& task, d1::task_group_context& context, d1::slot_id slot) {
  static auto* const original = Original<void(d1::task&, d1::task_group_context&, d1::slot_id)>(
      "_ZN3tbb6detail2r15spawnERNS0_2d14taskERNS2_18task_group_contextEt");
  original(*new OrderedTask(task), context, slot);
}

void execute_and_wait(d1::task& task, d1::task_group_context& task_context, d1::wait_context& wait,
                      d1::task_group_context& wait_context) {
  static auto* const original = Original<void(d1::task&, d1::task_group_context&, d1::wait_context&,
                                              d1::task_group_context&)>(
      "_ZN3tbb6detail2r116execute_and_waitERNS0_2d14taskERNS2_18task_group_contextERNS2_12wait_contextES6_");
  const AcquireAtEnd acquire(Count(wait));
  original(task, task_context, wait, wait_context);
}

void wait(d1::wait_context& wait, d1::task_group_context& context) {
  static auto* const original = Original<void(d1::wait_context&, d1::task_group_context&)>(
      "_ZN3tbb6detail2r14waitERNS0_2d112wait_contextERNS2_18task_group_contextE");
  const AcquireAtEnd acquire(Count(wait));
  original(wait, context);
}

void execute(d1::task_arena_base& arena, d1::delegate_base& delegate) {
  static auto* const original = Original<void(d1::task_arena_base&, d1::delegate_base&)>(
      "_ZN3tbb6detail2r17executeERNS0_2d115task_arena_baseERNS2_13delegate_baseE");
  const AcquireAtEnd acquire(&delegate);
  OrderedDelegate ordered(delegate);
  original(arena, ordered);
}

// Memory of tasks goes back to the thread that it came from without a lock.

void* allocate(d1::small_object_pool*& pool, std::size_t bytes) {
  static auto* const original = Original<void*(d1::small_object_pool*&, std::size_t)>(
      "_ZN3tbb6detail2r18allocateERPNS0_2d117small_object_poolEm");
  void* const memory = original(pool, bytes);
  __tsan_acquire(memory);
  return memory;
}

void* allocate(d1::small_object_pool*& pool, std::size_t bytes, const d1::execution_data& data) {
  static auto* const original =
      Original<void*(d1::small_object_pool*&, std::size_t, const d1::execution_data&)>(
          "_ZN3tbb6detail2r18allocateERPNS0_2d117small_object_poolEmRKNS2_14execution_dataE");
  void* const memory = original(pool, bytes, data);
  __tsan_acquire(memory);
  return memory;
}

void deallocate(d1::small_object_pool& pool, void* memory, std::size_t bytes) {
  static auto* const original = Original<void(d1::small_object_pool&, void*, std::size_t)>(
      "_ZN3tbb6detail2r110deallocateERNS0_2d117small_object_poolEPvm");
  __tsan_release(memory);
  original(pool, memory, bytes);
}

void deallocate(d1::small_object_pool& pool, void* memory, std::size_t bytes,
                const d1::execution_data& data) {
  static auto* const original =
      Original<void(d1::small_object_pool&, void*, std::size_t, const d1::execution_data&)>(
          "_ZN3tbb6detail2r110deallocateERNS0_2d117small_object_poolEPvmRKNS2_14execution_dataE");
  __tsan_release(memory);
  original(pool, memory, bytes, data);
}

}  // namespace r1
}  // namespace tbb::detail
