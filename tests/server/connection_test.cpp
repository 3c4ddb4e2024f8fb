// What a connection may do before its request is one, and what httplib would do with it.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "server/http_connection.h"
#include "tests/server/service_test.h"

namespace radbake::server {
namespace {

using ::testing::HasSubstr;
using ::testing::StartsWith;

TEST(Head, EndsAtItsEmptyLine) {
  const HttpLimits limits;
  EXPECT_EQ(HeadEnd("GET / HTTP/1.1\r\n\r\nbody", limits), 18U);
  EXPECT_FALSE(HeadEnd("GET / HTTP/1.1\r\n\r", limits));
  EXPECT_FALSE(HeadEnd("", limits));
}

TEST(Head, IsNoLongerThanAllowed) {
  HttpLimits limits;
  limits.head = 100;
  limits.headers = 3;
  EXPECT_THROW(HeadEnd(std::string(101, 'x'), limits), ProblemError) << "however it would go on";
  EXPECT_THROW(HeadEnd("x\r\na:\r\na:\r\na:\r\na:\r\n\r\n", limits), ProblemError);
  EXPECT_TRUE(HeadEnd("x\r\na:\r\na:\r\na:\r\n\r\n" + std::string(1000, 'x'), limits));
}

TEST(Head, KeepsFromHttplibWhatItHandlesBadly) {
  EXPECT_EQ(
      Harmless("GET / HTTP/1.1\r\nHost: x\r\nRANGE: bytes=0-1\r\ncontent-encoding: gzip\r\n\r\n"),
      "GET / HTTP/1.1\r\nHost: x\r\nRadbaked-RANGE: bytes=0-1\r\nRadbaked-content-encoding: gzip\r\n\r\n");
}

TEST(Head, LeavesOutWhatAClientCouldForge) {
  EXPECT_EQ(Harmless("GET / HTTP/1.1\r\nREMOTE_ADDR: 1.2.3.4\r\nRadbaked-Range: x\r\nLocal_Port: 1\r\n\r\n"),
            "GET / HTTP/1.1\r\n\r\n");
}

TEST(Head, HasNothingButHeaders) {
  using std::string_literals::operator""s;
  for (const std::string& line : {"no header"s, "Name : x"s, ": x"s, " folded: x"s, "a\tb: x"s, "a: x\ry"s,
                                  "a: x\ny"s, "a: \x01"s, "a: \0"s}) {
    EXPECT_THROW(Harmless("GET / HTTP/1.1\r\n" + line + "\r\n\r\n"), ProblemError) << line;
  }
}

TEST(Head, HidesNoHeaderInItsFirstLine) {
  EXPECT_THROW(Harmless("GET / HTTP/1.1\nRange: bytes=0-1\r\n\r\n"), ProblemError);
}

class ConnectionTest : public testing::Test {
 protected:
  Service Start(const HttpLimits& limits) const {
    return {folder_.path() / "data",
            WriteProgram(folder_.path() / "radbake", kBakes),
            {1, std::chrono::hours(1), limits, "", {}}};
  }
  static Answer Finish(const Descriptor& connection) {
    std::string text;
    ReceiveUntil(connection, "}", text);
    Answer answer;
    answer.status = text.size() > 12 ? std::atoi(text.c_str() + 9) : 0;
    answer.body = text;
    return answer;
  }

 private:
  TemporaryFolder folder_;
};

TEST_F(ConnectionTest, AHeadOverTheLimitsIsRefused) {
  const Service service = Start({});
  std::string headers;
  for (int i = 0; i < 65; ++i) {
    headers += "H: x\r\n";
  }
  const Answer many = service.client().Request("GET", "/healthz", headers);
  EXPECT_EQ(many.status, 431);
  EXPECT_EQ(many.headers.at("content-type"), "application/problem+json");
  EXPECT_THAT(many.body, HasSubstr("64 headers"));
  const Answer long_line =
      service.client().Request("GET", "/healthz", "H: " + std::string(1 << 20, 'x') + "\r\n");
  EXPECT_EQ(long_line.status, 431);
  EXPECT_THAT(long_line.body, HasSubstr("16384 bytes"));
}

TEST_F(ConnectionTest, ASlowHeadHoldsNobodyUp) {
  HttpLimits limits;
  limits.head_time = std::chrono::seconds(1);
  const Service service = Start(limits);
  std::vector<Descriptor> slow;
  slow.reserve(100);
  for (int i = 0; i < 100; ++i) {
    slow.push_back(Connect(service.port(), "GET /healthz HTTP/1.1\r\nHost"));
  }
  EXPECT_EQ(service.client().Get("/healthz").status, 200);
  const Answer late = Finish(slow[0]);
  EXPECT_EQ(late.status, 408);
  EXPECT_THAT(late.body, HasSubstr("within 1 seconds"));
}

TEST_F(ConnectionTest, AHeadMayComeInPieces) {
  const Service service = Start({});
  const Descriptor connection = Connect(service.port(), "GET /heal");
  for (const std::string piece : {"thz HTTP/1.1\r\nHo", "st: x\r\n\r", "\n"}) {
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
    ASSERT_EQ(::send(connection.get(), piece.data(), piece.size(), 0), static_cast<ssize_t>(piece.size()));
  }
  EXPECT_EQ(Finish(connection).status, 200);
}

TEST_F(ConnectionTest, ASlowBodyIsGivenUp) {
  HttpLimits limits;
  limits.idle_time = std::chrono::seconds(1);
  const Service service = Start(limits);
  const std::string head =
      "POST /v1/bakes HTTP/1.1\r\nContent-Type: model/gltf-binary\r\nContent-Length: 1000\r\n\r\nglTF";
  const Answer still = Finish(Connect(service.port(), head));
  EXPECT_EQ(still.status, 408);
  EXPECT_THAT(still.body, HasSubstr("too slowly"));
  // One that never stands still, and never gets anywhere.
  const Descriptor drip = Connect(service.port(), head);
  EXPECT_TRUE(Eventually([&] {
    std::this_thread::sleep_for(std::chrono::milliseconds(50));
    return ::send(drip.get(), "x", 1, MSG_NOSIGNAL) < 0 || [&] {
      char c = 0;
      return ::recv(drip.get(), &c, 1, MSG_DONTWAIT | MSG_PEEK) > 0;
    }();
  }));
  EXPECT_EQ(Finish(drip).status, 408);
}

TEST_F(ConnectionTest, AChunkOfEndlessSizeIsGivenUp) {
  const Service service = Start({});
  const std::string head =
      "POST /v1/bakes HTTP/1.1\r\nContent-Type: model/gltf-binary\r\nTransfer-Encoding: chunked\r\n\r\n";
  const Answer answer = Send(service.port(), head + std::string(1 << 20, '0'));
  EXPECT_EQ(answer.status, 400);
  EXPECT_THAT(answer.body, HasSubstr("breaks off"));
}

TEST_F(ConnectionTest, TooManyConnectionsAreTurnedAway) {
  HttpLimits limits;
  limits.connections = 2;
  const Service service = Start(limits);
  std::vector<Descriptor> open;
  open.push_back(Connect(service.port(), "GET"));
  open.push_back(Connect(service.port(), "GET"));
  const Answer full = service.client().Get("/healthz");
  EXPECT_EQ(full.status, 503);
  EXPECT_EQ(full.headers.at("retry-after"), "1");
  EXPECT_THAT(full.body, HasSubstr("2 connections"));
  open.clear();
  EXPECT_TRUE(Eventually([&] { return service.client().Get("/healthz").status == 200; }));
}

TEST_F(ConnectionTest, TooManyUploadsAtATimeAreTurnedAway) {
  HttpLimits limits;
  limits.uploads = 1;
  const Service service = Start(limits);
  Descriptor first;
  // It may come second: then it is the one that is turned away, and comes again.
  EXPECT_TRUE(Eventually([&] {
    first = Connect(
        service.port(),
        "POST /v1/bakes HTTP/1.1\r\nContent-Type: model/gltf-binary\r\nContent-Length: 1000\r\n\r\nglTF");
    return service.client().Post(Glb(), "model/gltf-binary").status == 503;
  }));
  first.Close();
  EXPECT_TRUE(Eventually([&] { return service.client().Post(Glb(), "model/gltf-binary").status == 202; }));
}

TEST_F(ConnectionTest, WhatFailsInsideIsNotShown) {
  const Service service = Start({});
  const std::string packed = std::string("\x1F\x8B\x08\x00", 4) + std::string(100, '\0');
  const Answer answer = service.client().Request("POST", "/v1/bakes/00112233445566778899aabbccddeeff/cancel",
                                                 "Content-Encoding: gzip\r\nContent-Length: 104\r\n", packed);
  EXPECT_EQ(answer.status, 404) << "the body is not unpacked";
  for (const auto& [name, value] : answer.headers) {
    EXPECT_NE(name, "exception_what");
  }
}

}  // namespace
}  // namespace radbake::server
