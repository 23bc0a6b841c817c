#include "firmware/hosts/device_listing.h"

#include <fmt/format.h>

#include <optional>
#include <utility>

#include "firmware/hosts/status.h"

namespace nodal::firmware {

void DeviceListing::ask(Client& client, std::uint64_t request) {
  scan_->begin();
  waiting_.push_back({client.number(), request});
  ++client.requests_open;
}

bool DeviceListing::step(const Clients& clients, const Replies& replies, Instant now) {
  if (waiting_.empty()) return false;
  const auto listed = scan_->take();
  if (!listed) return false;
  wire::Reply answer;
  std::optional<Error> error;
  if (!*listed) {
    error = listed->error();
  } else if ((*listed)->text.size() > kMaxDeviceListBytes || (*listed)->json.size() > kMaxDeviceListBytes) {
    error = Error{Errc::kTooLarge,
                  fmt::format("the list of devices is longer than {} KiB; on the board, `nodald --scan` prints it",
                              kMaxDeviceListBytes / 1024)};
  } else {
    fill_devices(**listed, *answer.mutable_devices());
  }
  for (const Waiting& waiting : std::exchange(waiting_, {})) {
    Client* const client = find_client(clients, waiting.client);
    if (!client) continue;
    --client->requests_open;
    answer.set_id(waiting.request);
    if (error) replies.refuse(*client, waiting.request, *error, now);
    else replies.send(*client, answer, now);
  }
  return true;
}

void DeviceListing::leave(std::uint64_t host) {
  std::erase_if(waiting_, [&](const Waiting& waiting) { return waiting.client == host; });
}

}  // namespace nodal::firmware
