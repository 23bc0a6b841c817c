#include "host_tool/rig/found_rigs.h"

#include <fmt/format.h>
#include <signal.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <chrono>
#include <condition_variable>
#include <mutex>
#include <optional>
#include <stop_token>
#include <thread>

#include "hal/linux/cable/host/cable_link.h"
#include "host_tool/child/child.h"
#include "host_tool/child/find_program.h"
#include "host_tool/rig/rig_address.h"
#include "protocol/base/text.h"
#include "protocol/base/try.h"

namespace nodal::host {
namespace {

constexpr std::size_t kMaxName = 100;

/// Whether it may stand in an address for --rig: no user, no port, nothing that ssh would expand.
bool is_host(const std::string& text) {
  return !text.empty() && text.find_first_of("@:[]") == std::string::npos &&
         parse_rig_address(fmt::format("ssh://{}", text), "ssh").has_value();
}

bool is_address(std::string_view text) {
  return !text.empty() && text.find_first_not_of("0123456789abcdefABCDEF.:") == std::string_view::npos;
}

/// avahi-browse writes a character of a name as "\DDD", three decimal digits, or with a backslash before it.
std::string unescaped(std::string_view text) {
  std::string plain;
  for (std::size_t k = 0; k < text.size(); ++k) {
    unsigned value = 0;
    if (text[k] != '\\' || k + 1 == text.size()) {
      plain += text[k];
    } else if (k + 3 < text.size() &&
               std::from_chars(text.data() + k + 1, text.data() + k + 4, value).ptr == text.data() + k + 4 &&
               value < 256) {
      plain += static_cast<char>(value);
      k += 3;
    } else {
      plain += text[++k];
    }
  }
  return plain;
}

struct Announced {
  FoundRig rig;
  bool v4 = false;
};

/// A line "=;eth0;IPv4;NAME;_nodal._tcp;local;HOST;ADDRESS;PORT;TEXTS".
std::optional<Announced> announced(std::string_view line) {
  constexpr std::size_t kFields = 9;
  std::array<std::string_view, kFields> fields;
  for (std::string_view& field : fields) {
    const std::size_t end = std::min(line.find(';'), line.size());
    field = line.substr(0, end);
    line.remove_prefix(std::min(end + 1, line.size()));
  }
  const auto& [mark, interface, family, name, type, domain, host, address, port] = fields;
  unsigned number = 0;
  const auto [end, error] = std::from_chars(port.data(), port.data() + port.size(), number);
  constexpr unsigned kHttps = 443, kPorts = 65536;
  if (mark != "=" || type != kRigService || error != std::errc() || end != port.data() + port.size() || number == 0 ||
      number >= kPorts || !is_host(std::string(host)) || !is_address(address))
    return std::nullopt;
  const bool v4 = address.find(':') == std::string_view::npos;
  const std::string at = v4 ? std::string(address) : fmt::format("[{}]", address);
  return Announced{{printable(unescaped(name), kMaxName), fmt::format("ssh://{}", host),
                    number == kHttps ? fmt::format("https://{}", at) : fmt::format("https://{}:{}", at, number)},
                   v4};
}

/// Kills a program that runs for longer.
class Deadline {
 public:
  Deadline(Child& child, Duration at_most)
      : thread_([this, &child, at_most](const std::stop_token& stop) {
          std::unique_lock lock(mutex_);
          never_.wait_for(lock, stop, std::chrono::nanoseconds(at_most.ns()), [] { return false; });
          if (!stop.stop_requested()) child.kill();
        }) {}

 private:
  std::mutex mutex_;
  std::condition_variable_any never_;
  std::jthread thread_;  ///< the last member: it ends first
};

Result<std::string> ask_avahi(Duration at_most) {
  const std::string program = find_program("avahi-browse");
  if (program.empty()) return fail(Errc::kNotFound, "avahi-browse is not installed: apt install avahi-utils");
  NODAL_TRY_ASSIGN(const auto child,
                   Child::start({.program = program,
                                 .arguments = {"--resolve", "--parsable", "--terminate", "--no-db-lookup", kRigService},
                                 .output = true}));
  const Result<std::string> text = [&] {
    const Deadline deadline(*child, at_most);
    return child->read_all(kMaxAnnouncements);
  }();
  if (!text) return text;
  const Child::End end = child->wait();
  if (end.signal == SIGKILL && text->empty())
    return fail(Errc::kTimeout, "avahi-browse gave no answer within --timeout");
  if (!end.good() && end.signal != SIGKILL)
    return fail(Errc::kDeviceFailed, fmt::format("avahi-browse {}", end_of(end, child->complaint())));
  return text;
}

}  // namespace

std::vector<FoundRig> announced_rigs(std::string_view text) {
  std::vector<Announced> found;
  while (!text.empty()) {
    const std::size_t end = std::min(text.find('\n'), text.size());
    auto next = announced(text.substr(0, end));
    text.remove_prefix(std::min(end + 1, text.size()));
    if (!next) continue;
    const auto same = std::ranges::find_if(found, [&](const Announced& each) {
      return each.rig.name == next->rig.name && each.rig.address == next->rig.address;
    });
    if (same == found.end()) {
      if (found.size() < kMaxAnnouncedRigs) found.push_back(std::move(*next));
    } else if (next->v4 && !same->v4) {
      *same = std::move(*next);
    }
  }
  std::vector<FoundRig> rigs;
  for (Announced& each : found) rigs.push_back(std::move(each.rig));
  return rigs;
}

FoundRigs find_rigs(Duration at_most) {
  FoundRigs found;
  if (const auto plugged = hal::cable::plugged_rigs()) {
    for (const hal::cable::PluggedRig& rig : *plugged)
      found.rigs.push_back({rig.name, fmt::format("usb:{}", rig.serial), ""});
  } else {
    found.notes.push_back(fmt::format("USB could not be searched: {}", plugged.error().message));
  }
  if (const auto text = ask_avahi(at_most)) {
    for (FoundRig& rig : announced_rigs(*text)) found.rigs.push_back(std::move(rig));
  } else {
    found.notes.push_back(fmt::format("the network could not be searched: {}", text.error().message));
  }
  return found;
}

}  // namespace nodal::host
