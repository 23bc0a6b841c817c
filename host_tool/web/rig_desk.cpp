#include "host_tool/web/rig_desk.h"

#include <algorithm>
#include <utility>

#include "host_tool/offload/take_fetch.h"
#include "protocol/base/try.h"
#include "protocol/take/file_names.h"

namespace nodal::host::web {
namespace {

/// Errors of the connection, after which it cannot be used.
bool is_lost(Errc code) {
  return code == Errc::kLinkClosed || code == Errc::kTimeout || code == Errc::kUnreachable || code == Errc::kProtocol ||
         code == Errc::kIo;
}

}  // namespace

Result<RigConnection*> RigDesk::connection() {
  if (rig_ != nullptr && rig_->now() - used_at_ > kTrusted) rig_.reset();
  if (rig_ == nullptr) {
    NODAL_TRY_ASSIGN(rig_, connect_());
  }
  used_at_ = rig_->now();
  return rig_.get();
}

template <class Work>
auto RigDesk::trying_twice(const Work& work) -> decltype(work(std::declval<RigConnection&>())) {
  for (const bool again : {true, false}) {
    NODAL_TRY_ASSIGN(RigConnection* const rig, connection());
    auto done = work(*rig);
    if (done || !is_lost(done.error().code)) return done;
    rig_.reset();
    if (!again || done.error().code == Errc::kTimeout) return done;
  }
  return fail(Errc::kLinkClosed, "the connection to the rig was lost");
}

Result<wire::Reply> RigDesk::ask(const wire::Request& request) {
  return trying_twice([&](RigConnection& rig) { return rig.ask(request); });
}

Result<RigDesk::State> RigDesk::state() {
  if (state_ && steady_now() - state_at_ < kFresh) return *state_;
  State now;
  wire::Request request;
  request.mutable_status();
  NODAL_TRY_ASSIGN(wire::Reply status, ask(request));
  now.status = std::move(*status.mutable_status());
  request.mutable_heads();
  NODAL_TRY_ASSIGN(wire::Reply heads, ask(request));
  now.heads = std::move(*heads.mutable_heads());
  request.mutable_exposure();
  NODAL_TRY_ASSIGN(wire::Reply exposure, ask(request));
  now.exposure = std::move(*exposure.mutable_exposure());
  now.rig_name = rig_ != nullptr ? rig_->rig().rig_name() : "";
  state_ = std::move(now);
  state_at_ = steady_now();
  return *state_;
}

Result<wire::Takes> RigDesk::takes() {
  wire::Request request;
  request.mutable_take_list();
  NODAL_TRY_ASSIGN(wire::Reply reply, ask(request));
  return std::move(*reply.mutable_takes());
}

Result<std::vector<std::uint8_t>> RigDesk::small_file(std::uint64_t take, const std::string& file, std::size_t limit) {
  return trying_twice([&](RigConnection& rig) { return fetch_small_file(rig, take, file, limit); });
}

Result<std::vector<take::Manifest::File>> RigDesk::files(std::uint64_t take) {
  if (const auto known = lists_.find(take); known != lists_.end()) return known->second;
  NODAL_TRY_ASSIGN(const auto bytes, small_file(take, take::kManifestFile, kMaxManifest));
  const std::string_view text(reinterpret_cast<const char*>(bytes.data()), bytes.size());
  NODAL_TRY_ASSIGN(take::Manifest manifest, take::parse_manifest(text, take::kManifestFile));
  if (lists_.size() >= kLists) lists_.erase(lists_.begin());
  return lists_[take] = std::move(manifest.files);
}

Result<wire::Reply> RigDesk::change(wire::Request request, const std::string& on_behalf) {
  NODAL_TRY_ASSIGN(RigConnection* const rig, connection());
  const auto& features = rig->rig().features();
  if (std::ranges::find(features, "on-behalf") != features.end()) request.set_on_behalf(on_behalf);
  Result<wire::Reply> reply = rig->ask(std::move(request));
  used_at_ = steady_now();
  state_.reset();
  if (!reply && is_lost(reply.error().code)) {
    rig_.reset();
    return fail(reply.error().code,
                "the connection to the rig was lost; look at its state before you try again: " + reply.error().message);
  }
  return reply;
}

}  // namespace nodal::host::web
