#include "server/multipart.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <tuple>
#include <vector>

#include "server/problem.h"

namespace radbake::server {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

// name, filename, content
using Parts = std::vector<std::tuple<std::string, std::string, std::string>>;

Parts Parse(const std::string& body, std::size_t step) {
  Parts parts;
  bool open = false;
  MultipartParser parser(
      "xyz", {[&](const MultipartParser::Part& part) {
                EXPECT_FALSE(open);
                open = true;
                parts.emplace_back(part.name, part.filename, "");
              },
              [&](std::string_view bytes) { std::get<2>(parts.back()) += bytes; }, [&] { open = false; }});
  for (std::size_t i = 0; i < body.size(); i += step) {
    parser.Feed(std::string_view(body).substr(i, step));
  }
  parser.End();
  EXPECT_FALSE(open);
  return parts;
}

std::string Refusal(const std::string& body) {
  try {
    Parse(body, 7);
  } catch (const ProblemError& error) {
    EXPECT_EQ(error.problem().status, 400);
    return error.problem().detail;
  }
  return "taken";
}

TEST(Multipart, ReadsPartsHoweverTheBytesArrive) {
  const std::string body =
      "preamble\r\n"
      "--xyz\r\nContent-Disposition: form-data; name=\"a\"\r\n\r\none\r\ntwo\r\n"
      "--xyz  \r\ncontent-type: image/png\r\nCONTENT-DISPOSITION:form-data;filename=\"d/b \\\"q\\\".png\"; "
      "name=b\r\n"
      "\r\n\r\n\r\n"
      "--xyz\r\nContent-Disposition: form-data; name=\"empty\"\r\n\r\n\r\n"
      "--xyz--\r\nepilogue";
  for (std::size_t step = 1; step <= body.size(); ++step) {
    EXPECT_THAT(Parse(body, step),
                ElementsAre(std::tuple("a", "", "one\r\ntwo"), std::tuple("b", "d/b \"q\".png", "\r\n"),
                            std::tuple("empty", "", "")))
        << "in steps of " << step;
  }
}

TEST(Multipart, TakesBytesThatAreAlmostABoundaryForContent) {
  const std::string content = "\r\n--xy\r\n-xyz\r\r\n\r\n--\r\n--xy";
  for (const std::size_t step : {1U, 2U, 3U, 5U, 8U, 1000U}) {
    EXPECT_THAT(
        Parse("--xyz\r\nContent-Disposition: form-data; name=\"a\"\r\n\r\n" + content + "\r\n--xyz--", step),
        ElementsAre(std::tuple("a", "", content)));
  }
}

TEST(Multipart, RefusesWhatIsNone) {
  const std::string header = "--xyz\r\nContent-Disposition: form-data; name=\"a\"\r\n";
  EXPECT_THAT(Refusal("hello"), HasSubstr("ends before"));
  EXPECT_THAT(Refusal(""), HasSubstr("ends before"));
  EXPECT_THAT(Refusal(header + "\r\nabc"), HasSubstr("ends before"));
  EXPECT_THAT(Refusal(header + "\r\nabc\r\n--xyz\r\n"), HasSubstr("ends before"));
  EXPECT_THAT(Refusal(header + "\r\nabc\r\n--xyzabc\r\n\r\n\r\n--xyz--"),
              HasSubstr("followed by something else"));
  EXPECT_THAT(Refusal("--xyz\r\n\r\nabc\r\n--xyz--"), HasSubstr("no name"));
  EXPECT_THAT(Refusal("--xyz\r\nContent-Disposition: attachment; name=\"a\"\r\n\r\nabc\r\n--xyz--"),
              HasSubstr("no name"));
  EXPECT_THAT(Refusal("--xyz\r\nContent-Disposition: form-data; name=\"\"\r\n\r\nabc\r\n--xyz--"),
              HasSubstr("no name"));
}

TEST(Multipart, HoldsNoHeaderWithoutEnd) {
  EXPECT_THAT(Refusal("--xyz\r\nContent-Disposition: form-data; name=\"" + std::string(100'000, 'a')),
              HasSubstr("too long"));
  EXPECT_THAT(Refusal("--xyz" + std::string(100'000, ' ')), HasSubstr("too long"));
}

TEST(Multipart, FindsTheBoundaryInAContentType) {
  EXPECT_EQ(MultipartBoundary("multipart/form-data; boundary=abc"), "abc");
  EXPECT_EQ(MultipartBoundary("Multipart/Form-Data; charset=utf-8; BOUNDARY=\"a b;c\""), "a b;c");
  EXPECT_EQ(MultipartBoundary("multipart/form-data"), "");
  EXPECT_EQ(MultipartBoundary("multipart/mixed; boundary=abc"), "");
  EXPECT_EQ(MultipartBoundary("multipart/form-data; boundary=" + std::string(71, 'a')), "");
}

}  // namespace
}  // namespace radbake::server
