#include "server/queue_lease.h"

#include <algorithm>
#include <utility>

namespace radbake::server {

std::vector<Held> LeaseWatch::Lapsed(const std::vector<Held>& held, Clock::time_point now) {
  const Clock::duration passed = std::min<Clock::duration>(now - looked_, lease_ / 3);
  looked_ = now;
  std::map<std::string, Seen> seen;
  std::vector<Held> lapsed;
  for (const Held& one : held) {
    const auto before = seen_.find(one.attempt.id);
    const bool same = before != seen_.end() && before->second.held == one;
    const Clock::duration silent = same ? before->second.silent + passed : Clock::duration::zero();
    if (silent >= lease_) {
      lapsed.push_back(one);
    }
    seen.emplace(one.attempt.id, Seen{one, silent});
  }
  seen_ = std::move(seen);
  return lapsed;
}

}  // namespace radbake::server
