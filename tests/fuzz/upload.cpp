// The rig's half of uploads against a model: any order of calls by any number of clients respects the limits,
// and a taken document is the one that was named. The input: operations as (what u8, which u8, offset u8, count
// u8).
#include "protocol/upload.h"

#include <algorithm>
#include <array>
#include <map>
#include <vector>

#include "protocol/base/bytes.h"

namespace {

using namespace nodal;

constexpr std::size_t kDocuments = 5;
constexpr UploadLimits kLimits{.document_bytes = 200, .documents = 3};

struct Document {
  std::vector<std::uint8_t> bytes;
  Sha256 sha256{};
};

// Two are at or over the limit, one is empty.
std::array<Document, kDocuments> make_documents() {
  std::array<Document, kDocuments> documents;
  constexpr std::array<std::size_t, kDocuments> kSizes{0, 1, 77, 200, 201};
  for (std::size_t i = 0; i < kDocuments; ++i) {
    documents[i].bytes.assign(kSizes[i], static_cast<std::uint8_t>(i));
    documents[i].sha256 = sha256(documents[i].bytes);
  }
  return documents;
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  static const auto documents = make_documents();
  UploadReceiver receiver(kLimits);
  std::map<std::size_t, std::size_t> begun;  // existing documents, and the most valid bytes that they can have
  std::map<std::size_t, bool> spoilt;
  ByteReader in(std::span(data, size));
  while (in.left() >= 4) {
    const unsigned what = in.u8();
    const std::size_t which = in.u8() % kDocuments;
    const Document& document = documents[which];
    const std::size_t offset = std::min<std::size_t>(in.u8(), document.bytes.size());
    const std::size_t count = std::min<std::size_t>(in.u8(), document.bytes.size() - offset);
    switch (what % 5) {
      case 0: {
        const auto go_on = receiver.begin(document.sha256, document.bytes.size());
        NODAL_ASSERT(go_on.has_value() == (document.bytes.size() <= kLimits.document_bytes));
        if (!go_on) break;
        NODAL_ASSERT(*go_on <= document.bytes.size());
        if (*go_on == 0) spoilt[which] = false;
        begun[which] = *go_on;
        break;
      }
      case 1: {
        const std::span piece(document.bytes.data() + offset, count);
        if (receiver.write(document.sha256, offset, piece)) NODAL_ASSERT(begun.contains(which));
        break;
      }
      case 2: {  // bytes that do not match the SHA-256
        const std::vector<std::uint8_t> wrong(count, 0xEE);
        if (receiver.write(document.sha256, offset, wrong)) spoilt[which] = true;
        break;
      }
      case 3: {
        const auto taken = receiver.take(document.sha256);
        if (taken) NODAL_ASSERT(*taken == document.bytes);
        if (!taken && taken.error().code == Errc::kChecksum) NODAL_ASSERT(spoilt[which]);
        if (!taken && taken.error().code == Errc::kTruncated) break;
        const Status again = receiver.write(document.sha256, 0, {});
        NODAL_ASSERT(!again);  // dropped, whether it was complete or not
        begun.erase(which);
        break;
      }
      default: {
        receiver.forget(document.sha256);
        begun.erase(which);
        const auto gone = receiver.take(document.sha256);
        NODAL_ASSERT(!gone && gone.error().code == Errc::kNotFound);
      }
    }
  }
  return 0;
}
