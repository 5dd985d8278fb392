# Nuno for CUDA with its kernels compiled ahead: a container starts without compiling anything.
#
#   docker build -t nuno .                                (ARCH: of the GPU that it will run on; sm_90 is H100 and H200)
#   docker run --rm --gpus all -v "$PWD/out:/out" nuno pick /opt/nuno/examples/pick-case --out /out
#
# The host needs NVIDIA's driver and container toolkit; all else of CUDA comes with Warp.
FROM python:3.12-slim-bookworm

ARG ARCH=sm_90
ARG EXTRAS=robot,viewer,wire,search

COPY . /opt/nuno
RUN pip install --no-cache-dir -c /opt/nuno/constraints.txt "/opt/nuno[${EXTRAS}]"

ENV WARP_CACHE_PATH=/opt/nuno-kernels \
    NVIDIA_VISIBLE_DEVICES=all \
    NVIDIA_DRIVER_CAPABILITIES=compute,utility
RUN nuno compile --arch ${ARCH} && chmod -R a+rwX ${WARP_CACHE_PATH}

ENTRYPOINT ["nuno"]
CMD ["--help"]
