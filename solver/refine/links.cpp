#include "solver/refine/links.h"

#include <utility>

namespace radbake {

void Links::Assign(const std::vector<Link>& links, std::size_t element_count, std::size_t cluster_count,
                   std::vector<PatchShare> shares) {
  cluster_count_ = cluster_count;
  shares_ = std::move(shares);
  const std::size_t rows = cluster_count + element_count;
  begin_.assign(rows + 1, 0);
  for (const Link& link : links) {
    ++begin_[Row(link.receiver) + 1];
  }
  for (std::size_t row = 0; row < rows; ++row) {
    begin_[row + 1] += begin_[row];
  }
  links_.resize(links.size());
  std::vector<std::size_t> next(begin_.begin(), begin_.end() - 1);
  for (const Link& link : links) {
    links_[next[Row(link.receiver)]++] = link;
  }
}

}  // namespace radbake
