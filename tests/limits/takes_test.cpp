// Rows of "A take".
#include <gtest/gtest.h>

#include <algorithm>
#include <map>
#include <string>
#include <vector>

#include "firmware/capture/capture_log.h"
#include "firmware/flight/flight_recorder.h"
#include "firmware/hosts/admission.h"
#include "firmware/hosts/take_sender.h"
#include "firmware/picture/blender.h"
#include "firmware/record/take_keeper.h"
#include "firmware/record/take_reader.h"
#include "firmware/record/take_recovery.h"
#include "firmware/record/take_shelf.h"
#include "firmware/record/take_writer.h"
#include "firmware/record/takes_in_use.h"
#include "heap.h"
#include "protocol/base/spsc_ring.h"
#include "protocol/take/seam_map.h"
#include "rows.h"

namespace nodal::limits {
namespace {

using namespace firmware;

constexpr std::uint64_t kSeamPixels = std::uint64_t{take::kMaxSeamColumns} * take::kMaxSeamColumns / 2;

/// The largest entry of a take that is complete, or of one that is damaged; the texts of both kinds are long.
TakeEntry largest_entry(bool complete) {
  TakeEntry entry;
  if (complete) {
    take::Manifest manifest;
    manifest.ended = std::string(take::kMaxTakeTextBytes, 'x');
    manifest.heads.resize(kMaxHeads);
    manifest.rates.resize(take::kMaxRates);
    entry.complete(manifest);
  } else {
    entry.problem = std::string(TakeShelf::kMaxProblemBytes, 'x');
  }
  return entry;
}

/// The list, and an answer to each host, of which one may ask for a list at a time.
std::uint64_t of_the_list(bool complete) {
  return peak_of([=] {
    std::map<std::uint64_t, TakeEntry> takes;
    for (std::uint64_t k = 0; k < TakeShelf::kMaxTakes; ++k) takes[k] = largest_entry(complete);
    std::vector<TakeAnswer::Listed> answers;
    for (std::size_t host = 0; host < Admission::in_all(Admission::kMaxClients); ++host) {
      TakeAnswer::Listed& listed = answers.emplace_back();
      for (const auto& [number, entry] : takes) listed.takes.push_back(entry);
    }
  });
}

std::uint64_t of_a_seam_map() {
  std::vector<std::uint8_t> labels(kSeamPixels);
  for (std::size_t k = 0; k < labels.size(); ++k) labels[k] = static_cast<std::uint8_t>(k % 2);
  const take::wire::Seams record = take::seams_record(0, take::kMaxSeamColumns, labels);
  return peak_of([&] { EXPECT_TRUE(take::labels_of(record)); });
}

TEST(LimitsOfMemory, OfTakes_AreThoseOnThePage) {
  check({
      {"takes on a rig's disk", Means::kHeap, [] { return std::max(of_the_list(true), of_the_list(false)); }},
      {"a recovery's memory, and attempts that fail", Means::kAddresses, [] { return kMaxRecoveryBytes; }},
      {"a map of placed seams", Means::kHeap, of_a_seam_map},
      {"placed seams on their way to a take", Means::kSizes,
       [] {
         return (SeamLog::kChangesWaiting + TakeWriter::kMaxSeamsAhead) * (sizeof(SeamChange) + 64 + kSeamPixels);
       }},
      {"hosts of which the rig notes that they read a take", Means::kSizes,
       [] { return sizeof(TakesInUse) + sizeof(TakeSender); }},
      {"a picture of a take", Means::kSizes, [] { return take::kMaxTakePictureBytes; }},
      {"pieces of a take on their way to a host", Means::kSizes,
       [] { return std::uint64_t{TakeReader::kBuffers * TakeReader::kPiece}; }},
      {"events on their way to a flight record", Means::kHeap,
       [] { return peak_of([] { SpscRing<CaptureEvent> events(FlightRecorder::kEvents); }); }},
      {"flight records since nodald's start, in memory and in a take", Means::kSizes,
       [] { return std::uint64_t{FlightLog::kMax}; }},
  });
}

}  // namespace
}  // namespace nodal::limits
