// Rows of nodal-web, and of what networks announce to a host.
#include <gtest/gtest.h>

#include "host_tool/look/request_rules.h"
#include "host_tool/rig/found_rigs.h"
#include "host_tool/web/devices.h"
#include "host_tool/web/download.h"
#include "host_tool/web/rig_desk.h"
#include "host_tool/web/web.h"
#include "protocol/take/documents.h"
#include "rows.h"

namespace nodal::limits {
namespace {

constexpr std::uint64_t kMebibyte = 1 << 20;
constexpr std::uint64_t kHeaders = 16 << 10;  // a connection has so many bytes for them (host_tool/look/server.cpp)
constexpr std::uint64_t kClosing = 16;        // connections whose end is not noticed yet, the same

TEST(LimitsOfMemory, OfNodalWeb) {
  using namespace host::web;
  check({
      {"connections of browsers, with their headers and bodies", Means::kSizes,
       [] { return (Web::kConnections + kClosing) * (host::look::Rules::kMaxBody + kHeaders); }},
      {"paired devices and codes", Means::kSizes, [] { return 2 * Devices::kMaxFile; }},  // the text, and what it says
      {"downloads at a time", Means::kSizes,
       [] { return Downloads::kMaxDownloads * (Downloads::kMaxWaiting + 1) * kMebibyte; }},
      {"lists of takes' files that are kept", Means::kSizes,
       [] { return RigDesk::kLists * take::kMaxTakeFiles * sizeof(take::Manifest::File); }},
      {"rigs that announce themselves in the network", Means::kSizes,
       [] { return 2 * host::kMaxAnnouncements + host::kMaxAnnouncedRigs * sizeof(host::FoundRig); }},
  });
}

}  // namespace
}  // namespace nodal::limits
