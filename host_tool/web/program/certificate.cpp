#include "host_tool/web/program/certificate.h"

#include <fmt/format.h>
#include <openssl/bio.h>
#include <openssl/ec.h>
#include <openssl/pem.h>
#include <openssl/rand.h>
#include <openssl/x509v3.h>

#include <array>
#include <memory>

#include "host_tool/console/files.h"
#include "host_tool/web/program/own_addresses.h"
#include "protocol/base/sha256.h"
#include "protocol/base/try.h"

namespace nodal::host::web {
namespace {

constexpr std::size_t kMaxCertificate = 64 << 10;
constexpr long kVersion3 = 2;
constexpr const char *kFrom = "20200101000000Z", *kUntil = "20491231235959Z";

struct Free {
  void operator()(BIO* bio) const { BIO_free(bio); }
  void operator()(EVP_PKEY* key) const { EVP_PKEY_free(key); }
  void operator()(X509* certificate) const { X509_free(certificate); }
  void operator()(X509_EXTENSION* extension) const { X509_EXTENSION_free(extension); }
};
template <class T>
using Owned = std::unique_ptr<T, Free>;

template <class Write>
std::string pem(const Write& write) {
  const Owned<BIO> bio(BIO_new(BIO_s_mem()));
  if (bio == nullptr || write(bio.get()) != 1) return "";
  char* bytes = nullptr;
  const long size = BIO_get_mem_data(bio.get(), &bytes);
  return size > 0 ? std::string(bytes, static_cast<std::size_t>(size)) : "";
}

bool add_extension(X509* certificate, int kind, const std::string& value) {
  X509V3_CTX context;
  X509V3_set_ctx_nodb(&context);
  X509V3_set_ctx(&context, certificate, certificate, nullptr, nullptr, 0);
  const Owned<X509_EXTENSION> extension(X509V3_EXT_conf_nid(nullptr, &context, kind, value.c_str()));
  return extension != nullptr && X509_add_ext(certificate, extension.get(), -1) == 1;
}

bool fill(X509* certificate, EVP_PKEY* key, const std::vector<std::string>& names) {
  constexpr std::size_t kSerialBytes = 16;
  std::array<unsigned char, kSerialBytes> serial{};
  if (RAND_bytes(serial.data(), static_cast<int>(serial.size())) != 1) return false;
  serial[0] = static_cast<unsigned char>((serial[0] & 0x7F) | 0x01);  // positive, and of this length
  const std::unique_ptr<BIGNUM, void (*)(BIGNUM*)> number(
      BN_bin2bn(serial.data(), static_cast<int>(serial.size()), nullptr), &BN_free);
  if (number == nullptr || BN_to_ASN1_INTEGER(number.get(), X509_get_serialNumber(certificate)) == nullptr)
    return false;
  std::string alternatives;
  for (const std::string& name : names)
    alternatives += fmt::format("{}{}:{}", alternatives.empty() ? "" : ",", is_address(name) ? "IP" : "DNS", name);
  X509_NAME* const subject = X509_get_subject_name(certificate);
  const auto* const common = reinterpret_cast<const unsigned char*>(names.front().c_str());
  constexpr std::size_t kMaxCommonName = 64;
  const int length = static_cast<int>(std::min(names.front().size(), kMaxCommonName));
  return X509_set_version(certificate, kVersion3) == 1 &&
         ASN1_TIME_set_string_X509(X509_getm_notBefore(certificate), kFrom) == 1 &&
         ASN1_TIME_set_string_X509(X509_getm_notAfter(certificate), kUntil) == 1 &&
         X509_NAME_add_entry_by_txt(subject, "CN", MBSTRING_ASC, common, length, -1, 0) == 1 &&
         X509_set_issuer_name(certificate, subject) == 1 && X509_set_pubkey(certificate, key) == 1 &&
         add_extension(certificate, NID_basic_constraints, "critical,CA:FALSE") &&
         add_extension(certificate, NID_key_usage, "critical,digitalSignature") &&
         add_extension(certificate, NID_ext_key_usage, "serverAuth") &&
         add_extension(certificate, NID_subject_alt_name, alternatives) &&
         X509_sign(certificate, key, EVP_sha256()) > 0;
}

}  // namespace

Result<Certificate> make_certificate(const std::vector<std::string>& names) {
  const Owned<EVP_PKEY> key(EVP_EC_gen("P-256"));
  const Owned<X509> certificate(X509_new());
  Certificate made;
  if (!names.empty() && key != nullptr && certificate != nullptr && fill(certificate.get(), key.get(), names)) {
    made.key =
        pem([&](BIO* to) { return PEM_write_bio_PrivateKey(to, key.get(), nullptr, nullptr, 0, nullptr, nullptr); });
    made.certificate = pem([&](BIO* to) { return PEM_write_bio_X509(to, certificate.get()); });
  }
  if (made.key.empty() || made.certificate.empty()) return fail(Errc::kIo, "OpenSSL could not make a certificate");
  return made;
}

Result<std::string> fingerprint_of(const std::filesystem::path& file) {
  NODAL_TRY_ASSIGN(const std::string text, read_file(file.string(), kMaxCertificate));
  const Owned<BIO> bio(BIO_new_mem_buf(text.data(), static_cast<int>(text.size())));
  const Owned<X509> certificate(bio == nullptr ? nullptr : PEM_read_bio_X509(bio.get(), nullptr, nullptr, nullptr));
  unsigned char* bytes = nullptr;
  const int size = certificate == nullptr ? 0 : i2d_X509(certificate.get(), &bytes);
  if (size <= 0) return fail(Errc::kBadFormat, fmt::format("{}: holds no certificate (PEM)", file.string()));
  const Sha256 digest = sha256({bytes, static_cast<std::size_t>(size)});
  OPENSSL_free(bytes);
  std::string shown;
  for (const std::uint8_t byte : digest) shown += fmt::format("{}{:02X}", shown.empty() ? "" : ":", byte);
  return shown;
}

}  // namespace nodal::host::web
