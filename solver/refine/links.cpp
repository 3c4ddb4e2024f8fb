#include "solver/refine/links.h"

namespace radbake {

void Links::Assign(const std::vector<Link>& links, std::size_t element_count) {
  begin_.assign(element_count + 1, 0);
  for (const Link& link : links) {
    ++begin_[link.receiver + 1];
  }
  for (std::size_t e = 0; e < element_count; ++e) {
    begin_[e + 1] += begin_[e];
  }
  links_.resize(links.size());
  std::vector<std::size_t> next(begin_.begin(), begin_.end() - 1);
  for (const Link& link : links) {
    links_[next[link.receiver]++] = link;
  }
}

}  // namespace radbake
