// multipart/form-data, with the boundary "b": however the bytes are cut, the same parts come out or the same
// refusal, and what a part's name becomes as a path stays inside its folder. The first byte says where to
// cut.
#include <algorithm>
#include <filesystem>

#include "server/multipart.h"
#include "server/problem.h"
#include "server/upload.h"
#include "tests/fuzz/fuzz.h"

namespace {

using namespace radbake;

// Everything that the parser tells, as one text.
std::string Parsed(std::string_view body, std::size_t step) {
  std::string told;
  server::MultipartParser parser("b",
                                 {[&](const server::MultipartParser::Part& part) {
                                    told += "<" + part.name + "|" + part.filename + ">";
                                  },
                                  [&](std::string_view bytes) { told += bytes; }, [&] { told += "</>"; }});
  try {
    for (std::size_t at = 0; at < body.size(); at += step) {
      parser.Feed(body.substr(at, step));
    }
    parser.End();
  } catch (const server::ProblemError& error) {
    fuzz::Demand(error.problem().status == 400, "what is no multipart is a 400");
    return "refused";
  }
  return told;
}

void CheckPath(std::string_view name) {
  try {
    const std::filesystem::path path = server::ResourcePath(name);
    fuzz::Demand(!path.empty() && path.is_relative(), "a part is a file of its folder");
    fuzz::Demand(std::none_of(path.begin(), path.end(),
                              [](const auto& step) { return step == ".." || step == "." || step.empty(); }),
                 "a part does not leave its folder");
  } catch (const server::ProblemError& error) {
    fuzz::Demand(error.problem().status == 422, "a bad name is a 422");
  }
}

}  // namespace

int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  if (size == 0) {
    return 0;
  }
  const std::string_view body = fuzz::Text(data + 1, size - 1);
  const std::string whole = Parsed(body, std::max<std::size_t>(body.size(), 1));
  fuzz::Demand(Parsed(body, 1U + data[0]) == whole, "how the body is cut makes no difference");
  CheckPath(body.substr(0, 400));
  server::MultipartBoundary(body.substr(0, 400));
  return 0;
}
