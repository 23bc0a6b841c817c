// Rows of "A rig, by its hosts" and "A rig, by its heads, button and files".
#include <gtest/gtest.h>

#include <algorithm>
#include <string>
#include <vector>

#include "firmware/calibration/rehearsal.h"
#include "firmware/capture/capture.h"
#include "firmware/config/config.h"
#include "firmware/hosts/admission.h"
#include "firmware/hosts/control.h"
#include "firmware/hosts/device_scan.h"
#include "firmware/hosts/fair_queue.h"
#include "firmware/hosts/frame_sender.h"
#include "firmware/hosts/publisher.h"
#include "firmware/hosts/status.h"
#include "firmware/operate/audit_log.h"
#include "firmware/operate/commands.h"
#include "firmware/operate/news.h"
#include "firmware/operate/operation.h"
#include "firmware/operate/settings.h"
#include "firmware/record/disk_test.h"
#include "firmware/record/waiting_tickets.h"
#include "firmware/storage/settings_store.h"
#include "hal/linux/cable/records.h"
#include "hal/linux/gpio/edge_log.h"
#include "hal/linux/gpio/pins.h"
#include "hal/linux/v4l2/scan.h"
#include "heap.h"
#include "protocol/base/spsc_ring.h"
#include "protocol/ssh_signature.h"
#include "rows.h"

namespace nodal::limits {
namespace {

using namespace firmware;

/// An entry of the audit log with its longest texts, each in a block of its own.
constexpr std::uint64_t kAuditEntry = sizeof(AuditEntry) + 5 * (kMaxAuditText + 16);
/// A command that waits for its answer: who asked, the command, the values before it.
constexpr std::uint64_t kOpenCommand = sizeof(Requester) + sizeof(Command) + 3 * (kMaxAuditText + 16) + 64;

std::uint64_t of_turns() {
  return peak_of([] {
    FairQueue queue;
    std::uint64_t number = 0;
    // So many users have their turn that the oldest are forgotten, and then the queue is full.
    for (std::uint32_t user = 0; user < 2 * FairQueue::kMaxParties; ++user) {
      queue.add({++number, Access::kControl, hal::PeerIdentity{user, static_cast<std::int32_t>(user)}});
      (void)queue.next();
    }
    for (std::size_t k = 0; k < FairQueue::kMaxWaiting; ++k)
      queue.add({++number, Access::kControl, hal::PeerIdentity{1, 1}});
  });
}

std::uint64_t of_the_log() {
  return peak_of([] {
    News news{Instant()};
    for (std::size_t kind = 0; kind < kNewsKinds; ++kind) {
      for (int k = 0; k < 10'000; ++k)
        news.say(static_cast<NewsKind>(kind), "x");  // short ones need most for their bytes
    }
  });
}

/// The most of these texts, read as what `read` reads.
template <class Read>
std::uint64_t of_reading(const std::vector<std::string>& texts, Read&& read) {
  std::uint64_t most = 0;
  for (const std::string& text : texts) most = std::max<std::uint64_t>(most, peak_of([&] { read(text); }));
  return most;
}

/// `head`, then `part` as often as `bytes` allow, then `tail`.
std::string filled(std::size_t bytes, const std::string& head, const std::string& part, const std::string& tail) {
  std::string text = head;
  while (text.size() + part.size() + tail.size() <= bytes) text += part;
  return text + tail;
}

std::vector<std::string> hostile_toml() {
  return {filled(kMaxRigTomlBytes, "a = [", "0,", "]"),      filled(kMaxRigTomlBytes, "a = [", "[],", "]"),
          filled(kMaxRigTomlBytes, "a = [", "{},", "]"),     filled(kMaxRigTomlBytes, "", "[[a]]\n", ""),
          filled(kMaxRigTomlBytes, "a = \"", "x", "\""),     filled(kMaxRigTomlBytes, "", "#\n", ""),
          filled(kMaxRigTomlBytes, "[[heads]]\n", "\n", ""), filled(kMaxRigTomlBytes, "", "[[heads]]\n", "")};
}

std::string signers_file() {
  // Principals fill the lines, which are as many as there may be.
  constexpr std::string_view kKey =
      " ssh-ed25519 AAAAC3NzaC1lZDI1NTE5AAAAIOMqqnkVzrm0SdG6UOoqKLsabgH5C9okWi0dh2l9GKJl\n";
  std::string text;
  const std::size_t line = kMaxAllowedSignersBytes / kMaxSigners;
  for (std::size_t k = 0; k < kMaxSigners; ++k) text += std::string(line - kKey.size(), 'x') + std::string(kKey);
  return text;
}

TEST(LimitsOfMemory, OfARigByItsHosts_AreThoseOnThePage) {
  check({
      {"bytes in a USB cable, each way", Means::kSizes,
       [] { return hal::cable::kTransfers * hal::cable::kTransferBytes; }},
      {"memory for parsing and compiling a document, before the rig does", Means::kAddresses,
       [] { return kMaxRehearsalBytes; }},
      {"unanswered requests of a host", Means::kSizes, [] { return Control::kMaxRequests * kOpenCommand; }},
      {"requests for a list of devices", Means::kSizes, [] { return 2 * kMaxDeviceListBytes; }},
      {"hosts that wait for something exclusive", Means::kHeap, of_turns},
      {"the audit log in memory", Means::kSizes, [] { return AuditLog::kMaxKept * kAuditEntry; }},
      {"entries of the audit log of a user and kind", Means::kSizes,
       [] {
         return AuditLog::kMaxKinds * 3 * kAuditEntry;
       }},  // the key, the newest text, the entry that others are merged with
      {"entries of the audit log that the disk has not taken", Means::kSizes,
       [] { return (AuditLog::kMaxFresh + 2 * AuditStore::kMaxUnwritten) * kAuditEntry; }},
      {"entries of the audit log in a reply", Means::kSizes, [] { return kMaxAuditReply * kAuditEntry; }},
      {"raymap buffers that pulls keep", Means::kSizes, [] { return std::uint64_t{Publisher::kMaxPinned}; }},
      {"raymaps that wait for lossless pulls", Means::kSizes, [] { return std::uint64_t{Publisher::kLosslessBytes}; }},
      {"frame sets in transit", Means::kSizes, [] { return std::uint64_t{FrameSender::kMaxCopies}; }},
      {"tests of the disk", Means::kSizes, [] { return std::uint64_t{DiskTest::kPiece}; }},
      {"requests that wait for the end of a test of the disk, or of a read before an eject", Means::kSizes,
       [] { return 2 * kMaxWaitingTickets * (sizeof(std::uint64_t) + sizeof(Presence)); }},
      {"settings, in memory and their file", Means::kSizes, [] { return 2 * kMaxSettingsBytes; }},
      {"bytes of log", Means::kHeap, of_the_log},
  });
}

TEST(LimitsOfMemory, OfARigByItsHeadsButtonAndFiles_AreThoseOnThePage) {
  check({
      {"`signers` of rig.toml", Means::kHeap,
       [] { return of_reading({signers_file()}, [](const auto& text) { EXPECT_TRUE(AllowedSigners::parse(text)); }); }},
      {"device nodes of a scan, and what each lists", Means::kSizes,
       [] {  // a vector that grows needs up to twice what it has
         return hal::v4l2::kMaxNodes * hal::v4l2::kMaxEnumerations * 2 * sizeof(hal::v4l2::FoundSize);
       }},
      {"open frame sets", Means::kSizes, [] { return std::uint64_t{Capture::kMaxOpenSets}; }},
      {"marks made with the button", Means::kSizes, [] { return Operation::kMarksKept * sizeof(Operation::Mark); }},
      {"pulses of a GPIO line not yet taken", Means::kSizes, [] { return sizeof(hal::gpio::EdgeLog); }},
      {"edges of a button not yet taken", Means::kHeap,
       [] { return peak_of([] { SpscRing<hal::PinEdge> edges(hal::gpio::GpioInputPin::kEdgesKept); }); }},
      {"rig.toml", Means::kHeap,
       [] {
         return of_reading(hostile_toml(), [](const auto& text) { EXPECT_FALSE(parse_rig_config(text, "rig.toml")); });
       }},
      {"the settings file at start", Means::kHeap,
       [] {
         const std::string head = Settings().encode(Sha256{});
         const std::vector<std::string> texts{
             filled(kMaxSettingsBytes, head, "a = 1\n", ""), filled(kMaxSettingsBytes, head, "[a]\n", ""),
             filled(kMaxSettingsBytes, head, "[[a]]\n", ""), filled(kMaxSettingsBytes, head + "a = [", "[],", "]"),
             filled(kMaxSettingsBytes, head + "a = \"", "x", "\"")};
         return of_reading(texts, [](const std::string& text) {
           const auto* const bytes = reinterpret_cast<const std::uint8_t*>(text.data());
           EXPECT_FALSE(Settings::decode({bytes, text.size()}, Sha256{}));
         });
       }},
  });
}

}  // namespace
}  // namespace nodal::limits
