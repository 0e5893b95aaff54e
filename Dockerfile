# syntax=docker/dockerfile:1
# forcefit with all extras, in two stages: the compiler is not in the image.
#     docker build -t forcefit .
#     docker run --rm --user "$(id -u):$(id -g)" -v "$PWD:/work" forcefit assembly solve irsbot2
# The container runs as the user who starts it, so that it may write into the folder.
FROM python:3.13-slim AS build
RUN apt-get update && apt-get install -y --no-install-recommends g++ git \
    && rm -rf /var/lib/apt/lists/*
COPY . /source
# the version is made from git's tags
RUN git config --global --add safe.directory /source \
    && pip wheel --no-cache-dir --no-deps --wheel-dir /wheels /source

FROM python:3.13-slim
# Exudyn and VTK load them, also where nothing is shown
RUN apt-get update && apt-get install -y --no-install-recommends libgl1 libegl1 libx11-6 \
    && rm -rf /var/lib/apt/lists/*
RUN --mount=type=bind,from=build,source=/wheels,target=/wheels \
    pip install --no-cache-dir "$(echo /wheels/*.whl)[all,mkl]"
# that user has no home folder: what is kept between runs is kept in /tmp, for one run
ENV HOME=/tmp
RUN useradd user
USER user
WORKDIR /work
ENTRYPOINT ["forcefit"]
