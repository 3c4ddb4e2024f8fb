/// A number of places, of which one is held as long as what Take() gave lives, which may be longer than the
/// places themselves. Thread-safe.
#pragma once

#include <atomic>
#include <cstddef>
#include <memory>

namespace radbake::server {

using Place = std::shared_ptr<void>;

class Places {
 public:
  explicit Places(std::size_t most) : most_(most) {}

  /// Null if all are taken.
  Place Take() {
    if (++*taken_ > most_) {
      --*taken_;
      return nullptr;
    }
    return {static_cast<void*>(taken_.get()), [taken = taken_](void*) { --*taken; }};
  }

 private:
  std::size_t most_;
  std::shared_ptr<std::atomic<std::size_t>> taken_ = std::make_shared<std::atomic<std::size_t>>(0);
};

}  // namespace radbake::server
