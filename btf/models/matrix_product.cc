// SPDX-License-Identifier: Apache-2.0
#include "btf/models/matrix_product.h"

#include <cblas.h>

#include "base/result.h"

namespace veneer::btf {
namespace {

// out = op(a) * op(b) + beta * out. An empty product is zero, which BLAS does not promise to write.
void gemm(CBLAS_TRANSPOSE op_a,
          CBLAS_TRANSPOSE op_b,
          Eigen::Index inner,
          const RowBlock& a,
          const RowBlock& b,
          float beta,
          MutableRowBlock& out) {
  if (out.size() == 0) return;
  if (inner == 0) {
    out *= beta;
    return;
  }
  cblas_sgemm(CblasRowMajor,
              op_a,
              op_b,
              static_cast<int>(out.rows()),
              static_cast<int>(out.cols()),
              static_cast<int>(inner),
              1.0F,
              a.data(),
              static_cast<int>(a.outerStride()),
              b.data(),
              static_cast<int>(b.outerStride()),
              beta,
              out.data(),
              static_cast<int>(out.outerStride()));
}

}  // namespace

void product(const RowBlock& a, const RowBlock& b, MutableRowBlock out) {
  VENEER_CHECK(a.cols() == b.rows() && out.rows() == a.rows() && out.cols() == b.cols());
  gemm(CblasNoTrans, CblasNoTrans, a.cols(), a, b, 0.0F, out);
}

void product_transposed(const RowBlock& a, const RowBlock& b, MutableRowBlock out) {
  VENEER_CHECK(a.cols() == b.cols() && out.rows() == a.rows() && out.cols() == b.rows());
  gemm(CblasNoTrans, CblasTrans, a.cols(), a, b, 0.0F, out);
}

void add_transposed_product(const RowBlock& a, const RowBlock& b, MutableRowBlock out) {
  VENEER_CHECK(a.rows() == b.rows() && out.rows() == a.cols() && out.cols() == b.cols());
  gemm(CblasTrans, CblasNoTrans, a.rows(), a, b, 1.0F, out);
}

std::string blas_description() { return openblas_get_config(); }

}  // namespace veneer::btf
