// SPDX-License-Identifier: Apache-2.0
#include "btf/models/matrix_product.h"

#include <cblas.h>

#include <algorithm>
#include <cstdlib>
#include <string_view>

#include "base/parallel.h"
#include "base/result.h"

// How OpenBLAS chooses its kernels; not in its headers, and absent where it was built for one
// processor only.
extern "C" {
void gotoblas_dynamic_init() __attribute__((weak));
void gotoblas_dynamic_quit() __attribute__((weak));
}

namespace veneer::btf {
namespace {

// Blocks of the result, each one product of one thread: the order in which sums are rounded does
// not depend on how many threads there are. Small enough for many cores, large enough that a
// block's operands are read into the cache for some use.
constexpr Eigen::Index kBlockRows = 64;
constexpr Eigen::Index kBlockColumns = 1024;

// OpenBLAS before 0.3.25, Debian 12's among them, takes a processor that is newer than itself for a
// Prescott of 2004 (its pull request 4268), which costs a factor of two to four. One with AVX2 is
// none: choose again, as if the user had said so in the environment.
void correct_kernels() {
#ifdef __x86_64__
  if (gotoblas_dynamic_init == nullptr || gotoblas_dynamic_quit == nullptr) return;
  if (std::getenv("OPENBLAS_CORETYPE") != nullptr) return;
  if (std::string_view(openblas_get_corename()) != "Prescott") return;
  if (!__builtin_cpu_supports("avx2") || !__builtin_cpu_supports("fma")) return;
  const bool avx512 = __builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512bw") &&
                      __builtin_cpu_supports("avx512dq") && __builtin_cpu_supports("avx512vl") &&
                      __builtin_cpu_supports("avx512cd");
  ::setenv("OPENBLAS_CORETYPE", avx512 ? "SkylakeX" : "Haswell", 0);
  gotoblas_dynamic_quit();
  gotoblas_dynamic_init();
#endif
}

// Once, before the first product.
void set_up_blas() {
  static const bool kDone = [] {
    correct_kernels();
    openblas_set_num_threads(1);
    return true;
  }();
  VENEER_CHECK(kDone);
}

// out = op(a) * op(b) + beta * out. An empty product is zero, which BLAS does not promise to write.
void gemm(CBLAS_TRANSPOSE op_a,
          CBLAS_TRANSPOSE op_b,
          Eigen::Index inner,
          const RowBlock& a,
          const RowBlock& b,
          float beta,
          MutableRowBlock& out,
          Threads threads) {
  if (out.size() == 0) return;
  if (inner == 0) {
    out *= beta;
    return;
  }
  set_up_blas();
  const Eigen::Index across = (out.cols() + kBlockColumns - 1) / kBlockColumns;
  const Eigen::Index down = (out.rows() + kBlockRows - 1) / kBlockRows;
  const auto make = [&](std::int64_t begin, std::int64_t end) {
    for (std::int64_t block = begin; block < end; ++block) {
      const Eigen::Index row = block / across * kBlockRows;
      const Eigen::Index column = block % across * kBlockColumns;
      cblas_sgemm(CblasRowMajor,
                  op_a,
                  op_b,
                  static_cast<int>(std::min(kBlockRows, out.rows() - row)),
                  static_cast<int>(std::min(kBlockColumns, out.cols() - column)),
                  static_cast<int>(inner),
                  1.0F,
                  a.data() + row * (op_a == CblasNoTrans ? a.outerStride() : 1),
                  static_cast<int>(a.outerStride()),
                  b.data() + column * (op_b == CblasNoTrans ? 1 : b.outerStride()),
                  static_cast<int>(b.outerStride()),
                  beta,
                  out.data() + row * out.outerStride() + column,
                  static_cast<int>(out.outerStride()));
    }
  };
  if (threads == Threads::kAll)
    parallel_for(across * down, 1, make);
  else
    make(0, across * down);
}

}  // namespace

void product(const RowBlock& a, const RowBlock& b, MutableRowBlock out, Threads threads) {
  VENEER_CHECK(a.cols() == b.rows() && out.rows() == a.rows() && out.cols() == b.cols());
  gemm(CblasNoTrans, CblasNoTrans, a.cols(), a, b, 0.0F, out, threads);
}

void product_transposed(const RowBlock& a,
                        const RowBlock& b,
                        MutableRowBlock out,
                        Threads threads) {
  VENEER_CHECK(a.cols() == b.cols() && out.rows() == a.rows() && out.cols() == b.rows());
  gemm(CblasNoTrans, CblasTrans, a.cols(), a, b, 0.0F, out, threads);
}

void add_transposed_product(const RowBlock& a,
                            const RowBlock& b,
                            MutableRowBlock out,
                            Threads threads) {
  VENEER_CHECK(a.rows() == b.rows() && out.rows() == a.cols() && out.cols() == b.cols());
  gemm(CblasTrans, CblasNoTrans, a.rows(), a, b, 1.0F, out, threads);
}

std::string blas_description() {
  set_up_blas();
  return fmt::format("{}, kernels for {}", openblas_get_config(), openblas_get_corename());
}

}  // namespace veneer::btf
