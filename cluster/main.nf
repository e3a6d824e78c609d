// One comparison by several workers: each takes cases until none is left, and the last process writes the report.
// nextflow run cluster/main.nf --experiment representations --workers 4
params.experiment = 'representations'
params.folder = 'results'
params.workers = 4
params.threads = 4
params.options = ''

process worker {
    cpus params.threads

    input:
    val k

    output:
    val k

    script:
    """
    cd '${launchDir}'
    kerrlight compare '${params.experiment}' -o '${params.folder}' --share=leave --threads ${task.cpus} ${params.options}
    """
}

process report {
    input:
    val workers

    script:
    """
    cd '${launchDir}'
    kerrlight compare '${params.folder}' --share
    """
}

workflow {
    worker(Channel.of(1..params.workers))
    report(worker.out.collect())
}
