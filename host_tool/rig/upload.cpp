#include "host_tool/rig/upload.h"

#include <fmt/format.h>

#include <algorithm>

#include "host_tool/console/quantities.h"
#include "host_tool/rig/not_recorded.h"
#include "protocol/base/try.h"
#include "protocol/upload.h"

namespace nodal::host {
namespace {

/// The part of the upload that one connection does.
Status send(RigConnection& rig, const UploadSender& sender, const UploadTerms& terms, Uploaded& state,
            Console& console) {
  wire::Request begin;
  *begin.mutable_upload_begin() = sender.begin();
  NODAL_TRY_ASSIGN(const wire::Reply answer, rig.ask(begin));
  const std::uint64_t offset = answer.upload().offset();
  if (offset != 0) {
    console.note(fmt::format("the rig already has {} of {}; the upload continues there", show_bytes(offset),
                             show_bytes(state.bytes)));
    state.resumed_at = offset;
  }
  if (offset < state.bytes) {
    NODAL_TRY_ASSIGN(BulkItem item, sender.item(offset));
    NODAL_TRY(rig.send_item(std::move(item)));
  }
  wire::Request commit;
  *commit.mutable_upload_commit() = sender.commit();
  if (terms.trial) commit.mutable_upload_commit()->set_trial_ns(static_cast<std::uint64_t>(terms.trial->ns()));
  commit.mutable_upload_commit()->set_signature(terms.signature);
  commit.mutable_upload_commit()->set_allow_older(terms.allow_older);
  const Result<wire::Reply> done =
      rig.ask_long(commit, [&](const wire::RigStatus& status) { console.activity(status.activity()); });
  console.finish_progress();
  if (!done) return fail(done.error());
  note_not_recorded(console, *done);
  return {};
}

bool worth_another_link(Errc code) {
  return code == Errc::kLinkClosed || code == Errc::kTimeout || code == Errc::kChecksum || code == Errc::kProtocol;
}

}  // namespace

Result<Uploaded> upload(const Reconnect& connect, std::vector<std::uint8_t> document, int attempts, Console& console,
                        const UploadTerms& terms) {
  Uploaded state;
  state.bytes = document.size();
  const UploadSender sender(std::make_shared<const std::vector<std::uint8_t>>(std::move(document)));
  for (state.links = 1;; ++state.links) {
    Status done;
    Result<std::unique_ptr<RigConnection>> rig = connect();
    if (rig) {
      done = send(**rig, sender, terms, state, console);
    } else {
      done = fail(rig.error());
    }
    if (done) return state;
    // The first connection must succeed; for later ones the rig may still be restarting.
    const Errc code = done.error().code;
    const bool again = worth_another_link(code) || (state.links > 1 && code == Errc::kUnreachable);
    if (!again || state.links >= attempts) return fail(done.error());
    console.warning(done.error().message + "; trying again");
  }
}

}  // namespace nodal::host
