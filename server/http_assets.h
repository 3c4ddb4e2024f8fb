/// What the service serves as it was built with: the web page, the modules of three.js, the OpenAPI document.
#pragma once

#include <httplib.h>

#include <map>
#include <string>
#include <string_view>

namespace radbake::server {

struct Asset {
  std::string type;
  std::string bytes;
  bool page = false;  ///< a document, which says what it may load
};

/// By path.
const std::map<std::string, Asset, std::less<>>& Assets();

/// Answers a GET or HEAD of it: 200 or 304.
void SendAsset(const httplib::Request& request, httplib::Response& response, const Asset& asset);

}  // namespace radbake::server
