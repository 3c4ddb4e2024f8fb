#include "server/http_assets.h"

#include <mutex>
#include <utility>

#include "page.css.h"
#include "page.html.h"
#include "page.js.h"
#include "server/digest.h"
#include "server/http_connection.h"
#include "server/http_result.h"
#include "server/openapi.h"
#include "three.h"

namespace radbake::server {
namespace {

// Its own scripts and styles, its own answers, and the images that a .glb carries.
constexpr const char* kPolicy =
    "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' blob: data:; "
    "connect-src 'self' blob: data:; base-uri 'none'; form-action 'none'; frame-ancestors 'none'";

constexpr std::size_t kTagSize = 16;

std::map<std::string, Asset, std::less<>> MakeAssets() {
  const std::string script = "text/javascript; charset=utf-8";
  std::map<std::string, Asset, std::less<>> assets = {
      {"/", {"text/html; charset=utf-8", kPage, true}},
      {"/page.css", {"text/css; charset=utf-8", kPageStyle, false}},
      {"/page.js", {script, kPageScript, false}},
      {"/openapi.json", {"application/json", OpenApi(), false}}};
  for (const auto& [path, text] : kThree) {
    assets[path] = {script, text, false};
  }
  return assets;
}

struct Packed {
  std::string tag;  // unquoted, of the bytes
  std::string bytes;
};

// Each is packed when it is first asked for: most processes that serve never are.
const Packed& Pack(const Asset& asset) {
  static std::mutex mutex;
  static std::map<const Asset*, Packed> packed;
  const std::lock_guard lock(mutex);
  const auto [found, is_new] = packed.try_emplace(&asset);
  if (is_new) {
    found->second = {Sha256Hex(asset.bytes).substr(0, kTagSize), Gzip(asset.bytes)};
  }
  return found->second;
}

}  // namespace

const std::map<std::string, Asset, std::less<>>& Assets() {
  static const std::map<std::string, Asset, std::less<>> kAssets = MakeAssets();
  return kAssets;
}

void SendAsset(const httplib::Request& request, httplib::Response& response, const Asset& asset) {
  const bool gzip = TakesGzip(Header(request, "Accept-Encoding"));
  const Packed& packed = Pack(asset);
  const std::string tag = "\"" + packed.tag + (gzip ? ".gzip" : "") + "\"";
  response.set_header("ETag", tag);
  response.headers.erase("Cache-Control");
  response.set_header("Cache-Control", "no-cache");
  response.set_header("Vary", "Accept-Encoding");
  if (asset.page) {
    response.set_header("Content-Security-Policy", kPolicy);
    response.set_header("Referrer-Policy", "no-referrer");
  }
  if (HasTag(Header(request, "If-None-Match"), tag)) {
    response.status = 304;
    return;
  }
  response.status = 200;
  if (gzip) {
    response.set_header("Content-Encoding", "gzip");
  }
  response.set_content(gzip ? packed.bytes : asset.bytes, asset.type);
}

}  // namespace radbake::server
